"""Which search is best with the same number of simulations: tables for docs/results/search.md.

`agentflow sweep search_budget` makes the runs, and can be interrupted and resumed;
`python benchmarks/budget.py sweeps/search_budget` then writes the tables of those that are
finished: best scores, differences from the default strategy, and how scores rise, which it also
draws.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

from learning import write

import agentflow
from agentflow.app.sweeps.tables import read_sweep_result
from agentflow.metrics.intervals import bootstrap_mean
from agentflow.metrics.tables import Column, Row, Table, markdown
from agentflow.runs import read_events
from agentflow.search.settings import SearchSettings

PAGE = Path(__file__).parent.parent / "docs/results/search.md"
PICTURES = PAGE.parent.parent / "pictures/results"
BEGIN = "<!-- made by benchmarks/budget.py: do not edit -->"
DEFAULT = SearchSettings().strategy
AFTER = (10, 20, 40, 60, 85)
"""Simulations, and calls, after which the best score so far is shown."""


class Course(NamedTuple):
    """How a run got to its best score."""

    by_simulations: tuple[float, ...]
    """The best score after each simulated machine."""
    by_calls: tuple[float, ...]
    """The best score when each call had been answered."""

    @property
    def best(self) -> float:
        """At the end."""
        return self.by_simulations[-1]


Courses = Mapping[tuple[str, str], Mapping[int, Course]]
"""(task, condition) -> seed -> course."""


def course_of(run: Path) -> Course:
    """The course of a recorded run; a machine that is met again is not simulated again."""
    best, seen = 0.0, set[str]()
    scores: list[float] = []
    answered: list[float] = []
    for event in read_events(run):
        if event.kind == "attempt":
            answered.append(best)
        elif event.kind == "evaluation" and event.data["machine"] not in seen:
            seen.add(event.data["machine"])
            best = max(best, event.data["score"] or 0.0)
            scores.append(best)
    return Course(tuple(scores), (*answered[1:], best))


def read(folder: Path) -> Courses:
    """The courses of all finished runs of a sweep."""
    found: dict[tuple[str, str], dict[int, Course]] = {}
    for run in read_sweep_result(folder).finished:
        config = run.planned.config
        course = course_of(folder / "runs" / run.planned.name)
        found.setdefault((config.task, run.planned.variant), {})[config.seed] = course
    return found


def best_table(courses: Courses) -> Table:
    """The best scores of each strategy, and by how much the default one differs."""
    rows = []
    for (task, condition), runs in courses.items():
        ours = courses.get((task, DEFAULT), {})
        apart = [ours[seed].best - run.best for seed, run in runs.items() if seed in ours]
        own = condition == DEFAULT or not apart
        won = sum(value > 0 for value in apart), sum(value < 0 for value in apart)
        best = mean_text([run.best for run in runs.values()])
        differs = ("", "") if own else (mean_text(apart), f"{won[0]} : {won[1]}")
        rows.append(Row((task, condition), (len(runs), best, *differs)))
    return Table(
        "Best score with the same number of simulations",
        ("task", "strategy"),
        (
            *(Column("", name) for name in ("seeds", "best score")),
            *(Column(f"{DEFAULT} - strategy", name) for name in ("mean", "better : worse")),
        ),
        tuple(rows),
        notes=(
            "Means over seeds with 95 % bootstrap intervals; differences are between runs with the "
            "same seed. If the interval of a difference includes 0, either may be ahead.",
        ),
    )


def course_table(courses: Courses, title: str, along: Callable[[Course], Sequence[float]]) -> Table:
    """The mean best score after a few of many simulations or calls."""
    rows = []
    for labels, runs in courses.items():
        lines = [along(run) for run in runs.values()]
        means = (fmean(line[min(count, len(line)) - 1] for line in lines) for count in AFTER)
        rows.append(Row(labels, tuple(f"{mean:.1f}" for mean in means)))
    columns = tuple(Column("", str(count)) for count in AFTER)
    return Table(title, ("task", "strategy"), columns, tuple(rows))


def mean_text(values: Sequence[float]) -> str:
    """A mean with its interval."""
    interval = bootstrap_mean(values)
    ends = f" [{interval.low:.1f}, {interval.high:.1f}]" if interval else ""
    return f"{fmean(values):.1f}{ends}"


def draw(folder: Path) -> None:
    """Curves of all finished runs of a sweep, over simulations and over calls."""
    for along in ("simulations", "calls"):
        figure = agentflow.plot(folder, view="curve", by=along)
        figure.savefig(PICTURES / f"search-{along}.webp", dpi=140)


def main() -> None:
    """Write the tables of a sweep, finished or not, and draw its curves."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sweep", type=Path)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    courses = read(options.sweep)
    tables = (
        best_table(courses),
        course_table(courses, "Best score after so many simulations", lambda c: c.by_simulations),
        course_table(courses, "Best score after so many calls", lambda c: c.by_calls),
    )
    write(options.page, "\n\n".join(map(markdown, tables)), BEGIN)
    draw(options.sweep)
    print(options.page)


if __name__ == "__main__":
    main()
