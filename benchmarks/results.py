"""Writes docs/results/published.md: tables of finished sweeps, and the best known machines.

`scripts/results` runs the sweeps first.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterable
from pathlib import Path

from agentflow.app.pages.tasks import level_picture
from agentflow.app.sweeps.folder import read_folder
from agentflow.app.sweeps.registry import VIEWS
from agentflow.app.sweeps.tables import FinishedRun, layout_table, read_sweep_result
from agentflow.env.tasks.records import record_of
from agentflow.env.tasks.registry import get_task, task_names
from agentflow.metrics.tables import markdown
from agentflow.runs import read_document

ORDER = (
    "workflows",
    "hierarchical_stages",
    "iterative_stages",
    "no_model_baseline",
    "coding_agent",
    "meta_designer",
    "inspector",
    "feedback_content",
    "edit_history",
    "search_strategy",
    "search_depth",
    "representation",
    "spatial_information",
    "additional_tasks",
    "gearing",
    "structures",
)
FURTHER = {
    "workflows": ("scores",),
    "search_strategy": ("expansions",),
    "additional_tasks": ("human",),
}
"""Sweep -> views to show in addition to the published layout."""
RECORDED = "pybullet"
"""The engine of the records that are shown."""
SIZE = (640, 480)
"""Of pictures, pixels."""
OF_RECORDS = """\
What the scores above can be compared with: the [record](../reference/tasks.md) of the first level
of each family, from any of the models and searches that have been tried, where it starts. The
sweeps above keep their own best machines in the folders of their runs."""
HEAD = """\
# Results of the shipped sweeps

This page shows what each part of agentflow contributes: workflows, roles, feedback, search
strategies and representations of machines, each in a table next to the published one. It is for
everyone who chooses between them or wants to compare a model of their own.

A *sweep* runs many configurations that differ only in the setting under study;
[sweeps](../how-to/sweeps.md) explains how. [Workflows and search](../explanation/search.md)
explains workflows, stages and search strategies, and
[prompts and roles](../explanation/prompts-and-roles.md) explains roles such as the refiner.

## How to read the tables

Every row names the model that was used:

* `procedural (no language model)` is the built-in model. It combines fixed rules with random
  choices, reads the same prompts as a language model, and writes replies in the same format. It
  takes its data from prompts but ignores their wording, what feedback says, and the sampling
  temperature, so rows that differ only in these are equal: a difference between them is not
  measured here. Its scores show that the system works end to end and what each part contributes;
  they say nothing about language models.
* `none (random edits)` marks the two baselines that use no model: random machines with random
  edits (`random-dsl`), and cogs placed at random (`random-placement`).

Tables headed "published" have the scores of other models in the game Besiege itself. Compare the
order of their rows with the order of ours, not the values: the simulator does not reproduce the
game (see [physics](../explanation/physics.md)). The published tables are taken from the paper,
*Agentic Design of Compositional Machines* ([arXiv:2510.14980](https://arxiv.org/abs/2510.14980)).
The table on structures is from another source, which its note names.

Most sweeps use two seeds, to match the small number of runs behind the published tables. The
machines of one run share a blueprint and are therefore similar, so
[intervals](../explanation/scores.md#intervals) over pooled machines are too narrow: differences of
a few metres between two throwing rows are noise. Use `--seeds 20` to tell such rows apart.

`scripts/results` generates everything on this page: it runs each sweep with the command shown in
its section, then writes the page with `python benchmarks/results.py`. Notes below each table define
its columns.
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sweeps", type=Path, default=Path("sweeps"))
    parser.add_argument("--out", type=Path, default=Path("docs/results/published.md"))
    given = parser.parse_args()
    folders = [given.sweeps / name for name in ORDER if (given.sweeps / name).is_dir()]
    pictures = Path(__file__).parent.parent / "docs" / "pictures" / "results"
    pictures.mkdir(parents=True, exist_ok=True)
    parts = [HEAD, *map(section, folders), gallery(pictures, given.out.parent)]
    given.out.write_text("\n".join(parts), encoding="utf-8")
    print(f"{given.out}: {len(folders)} of {len(ORDER)} sweeps")


def section(folder: Path) -> str:
    """Section about a sweep: description, command, tables."""
    document, sweep = read_folder(folder)
    swept = read_sweep_result(folder)
    made = (
        f"`agentflow sweep configs/{folder.name}.yaml` and `agentflow table {folder} "
        f"--published --format md`; started on {document['begun'][:10]}, "
        f"commit {commits(swept.finished)}, hash of the constants `{document['constants']}`"
    )
    texts = [re.sub(r"\A\*\*.*\*\*\n\n", "", markdown(layout_table(swept, published=True)))]
    for name in FURTHER.get(folder.name, ()):
        texts += [f"Output of `agentflow table {folder} --show {name} --format md`:", ""]
        texts.append(markdown(VIEWS[name](swept)))
    return "\n".join([f"## {sweep.title}", "", sweep.about, "", f"Commands: {made}.", "", *texts])


def commits(runs: Iterable[FinishedRun]) -> str:
    """Commits of the code that made these runs, in the order of the runs."""
    made = dict.fromkeys(str(read_document(run.path)["commit"]) for run in runs)
    return ", ".join(f"`{commit[:10]}`" for commit in made)


def gallery(pictures: Path, base: Path) -> str:
    """Section with a picture of the best known machine of each family, on its first level."""
    lines = ["## The best known machine of each family", "", OF_RECORDS, ""]
    for family in sorted(name for name in task_names() if "/" not in name):
        task = get_task(family, engine=RECORDED)
        record, file = record_of(task), pictures / f"{family}.png"
        assert record is not None
        file.write_bytes(level_picture(family, SIZE))
        score = f"{record.verified:,.2f} {task.unit}".strip()
        lines += [
            f"![The best known machine of {family}]({os.path.relpath(file, base)})",
            "",
            f"{family}: verified score {score}, `records/{record.name}.json`, {record.how}",
            "",
        ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
