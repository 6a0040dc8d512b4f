"""Difficulty of the levels: reference machines on every level, and the best of 60 rollouts.

    python benchmarks/difficulty.py [family ...] [--cells FILE] [--out FILE] [--seed S]

Writes one table per family with a column per level: the score of each reference machine
(tests/machines/<family>.yaml), the best of 60 machines of the procedural designer, and the best of
60 rollouts of random-dsl; for gearing, how many of 60 placements of each pass.
Each value is saved in FILE as soon as it is known, with everything it depends on in its key, and
never computed again, so an interrupted run can be continued.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from shelf import families, load, read

from agentflow.app.design.run import design
from agentflow.config.run import build_config
from agentflow.env.constants import constants
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_level, get_task, task_names
from agentflow.machine.brief import LONE_ROOT
from agentflow.prompts.render import PromptSet

ROLLOUTS = 60
HERE = Path(__file__).parent
CELLS, PAGE = HERE / "data" / "difficulty.jsonl", HERE.parent / "docs" / "results" / "difficulty.md"
INTRO = """\
This page shows how hard each level is: what reference machines score, and what is reached \
without a language model. Use it to choose a level, or to judge what a score on one is worth.

There is one table per task family, with a column for each level and these rows:

| row | what it shows |
|---|---|
| good score | what the author of the level considers a good result |
| names of machines | scores of the [reference machines](../reference/tasks.md#reference-machines) \
in `tests/machines` on every level of their family; a dash means that the level does not allow the \
machine |
| procedural designer | the best of {rollouts} machines of the built-in procedural model, which is \
not a language model; for gearing, how many of {rollouts} attempts pass |
| random-dsl | the best of {rollouts} random machines and random edits |
| random-placement | for gearing instead of random-dsl: how many of {rollouts} random placements \
of cogs pass |"""

SENSED = """\
## Levels where machines sense

Scores of reference machines are successful trials out of ten. \
[Machines that sense](controllers.md) shows what first machines of the procedural model reach."""


class Cells:
    """Saved results, one JSON line each; the key names everything the result depends on."""

    def __init__(self, path: Path) -> None:
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        whole = (line for line in lines if line.endswith("}"))
        self._known = {item["key"]: item["value"] for item in map(json.loads, whole)}

    def get(self, key: str, work: Callable[[], Any]) -> Any:
        """The value of a key, computed and saved if it is new."""
        key = f"{key} {constants().digest}"
        if key not in self._known:
            print(key, file=sys.stderr, flush=True)
            value = self._known[key] = work()
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"key": key, "value": value}) + "\n")
        return self._known[key]


def score_on(name: str, level: str) -> float | None:
    """Score of a reference machine on a level; None if the level does not allow it.

    Raises:
        RuntimeError: The simulation timed out, which says nothing about the machine.
    """
    rollout = simulate(load(name), get_task(level))
    if rollout.status == "timeout":
        raise RuntimeError(f"{name} on {level} timed out; run the benchmark again")
    return None if rollout.status == "invalid" else rollout.score


def best_of_designs(level: str, workflow: str, seed: int) -> dict[str, Any]:
    """Best score of 60 rollouts, and the number that passed if the workflow counts attempts."""
    count = {
        "single": {"trajectories": ROLLOUTS, "search": {"rounds": 0}},
        "random-dsl": {"max_simulations": ROLLOUTS},
    }.get(workflow, {"placements": ROLLOUTS})
    document = {
        "task": level,
        "workflow": workflow,
        "seed": seed,
        "settings": count,
        "verify": False,
    }
    with tempfile.TemporaryDirectory() as folder:
        result = design(build_config(document), Path(folder))
    passes = result.attempts.passes if result.attempts else None
    return {"best": result.score, "passes": passes}


def rows(family: str, cells: Cells, seed: int, *, senses: bool = False) -> list[list[str]]:
    """Rows of a family's table, the header first: of the levels where machines sense, or of the
    others; [] if there are none."""
    tasks = {name: get_task(name) for name in task_names()}
    levels = [
        name
        for name, task in tasks.items()
        if task.family == family and task.brief.limits.senses == senses
    ]
    if not levels:
        return []
    placed = get_task(levels[0]).brief.given != LONE_ROOT
    table = [
        ["machine", *levels],
        ["good score", *(_number(get_level(level).file.good) for level in levels)],
    ]
    references = [item.machine for item in read(family).references if item.level in levels]
    for name in dict.fromkeys(references):
        digest = load(name).digest
        scores = [
            cells.get(f"{level_key(level)} {digest}", partial(score_on, name, level))
            for level in levels
        ]
        table.append([Path(name).stem.replace("_", " "), *map(_number, scores)])
    if senses:  # docs/results/controllers.md has first machines
        return table
    prompts = PromptSet().digest
    kinds = ("placement", "random-placement") if placed else ("single", "random-dsl")
    for kind in kinds:
        found = [
            cells.get(
                f"{level_key(level)} {kind} {seed} {prompts}",
                partial(best_of_designs, level, kind, seed),
            )
            for level in levels
        ]
        designer = "procedural designer" if kind in ("single", "placement") else kind
        measure = "passes out" if placed else "best"
        table.append([f"{designer}, {measure} of {ROLLOUTS}", *map(_best_or_passes, found)])
    return table


def level_key(level: str) -> str:
    """Name and content hash of a level."""
    shown = repr(get_task(level).parameters).encode()
    return f"{level} {hashlib.sha256(shown).hexdigest()[:8]}"


def _best_or_passes(found: dict[str, Any]) -> str:
    return _number(found["best"]) if found["passes"] is None else str(found["passes"])


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def markdown(table: list[list[str]]) -> str:
    """A table in Markdown."""
    head, *body = (f"| {' | '.join(row)} |" for row in table)
    rule = "|---" + "|--:" * (len(table[0]) - 1) + "|"
    return "\n".join((head, rule, *body))


def main() -> None:
    """Compute the missing values and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("families", nargs="*", help="all by default")
    parser.add_argument("--cells", type=Path, default=CELLS)
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    cells = Cells(options.cells)
    parts = [
        "# Difficulty of the levels",
        INTRO.format(rollouts=ROLLOUTS),
        "`python benchmarks/difficulty.py` generates this page. Levels for machines that sense "
        "come last; [Machines that sense](controllers.md) has more about them.",
    ]
    chosen = options.families or families()
    for family in chosen:
        parts += [f"## {family}", markdown(rows(family, cells, options.seed))]
    parts.append(SENSED)
    for family in chosen:
        if found := rows(family, cells, options.seed, senses=True):
            parts.append(markdown(found))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    print(options.out)


if __name__ == "__main__":
    main()
