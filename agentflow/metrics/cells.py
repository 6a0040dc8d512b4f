"""Owns the numbers that stand in tables of sweeps, by the names that the published tables use.

A cell is everything of some runs that one number is made of; seeds are pooled, not averaged.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from agentflow.metrics import search
from agentflow.metrics.records import CandidateRecord, ExpansionRecord, RunRecord
from agentflow.metrics.scores import Scores
from agentflow.metrics.validity import Rate, after_retries, first_attempts
from agentflow.registry import Registry, instance_of

Value = float | int | str | Rate | None
"""What a cell of a table shows; None where there is nothing to show."""


@dataclass(frozen=True)
class Member:
    """What metrics know of one finished run."""

    record: RunRecord
    width: int
    """Children that each of its expansions wanted."""


@dataclass(frozen=True)
class Cell:
    """Some runs, and which of their machines count."""

    runs: tuple[Member, ...]
    stage: str
    rounds: int | None = None
    """The searches as they were after so many rounds; None for the stage as it ended."""

    @property
    def candidates(self) -> list[CandidateRecord]:
        """Of the stage, all runs together."""
        return [item for run in self.runs for item in run.record.stage(self.stage)]

    @property
    def expansions(self) -> list[ExpansionRecord]:
        """All runs together, their trajectories told apart."""
        return [
            ExpansionRecord(number * 1_000_000 + e.trajectory, e.round, e.attempts, e.children)
            for number, run in enumerate(self.runs)
            for e in run.record.expansions
        ]

    @property
    def scores(self) -> Scores:
        """Of the stage's machines, or of the best of each tree after `rounds`."""
        if self.rounds is None:
            return Scores.of(self.candidates)
        found: list[float] = []
        for run in self.runs:
            if search.deepest(run.record) >= self.rounds:
                found += search.best_after_rounds(run.record, self.rounds).values()
        return Scores(tuple(found), 0)


@dataclass(frozen=True)
class Metric:
    """A number of a cell."""

    of: Callable[[Cell], Value]
    about: str
    """What it is, as told under tables."""
    percent: bool = False
    """Whether it is shown as a percentage."""


def _child_rate(cell: Cell) -> float | None:
    parts = (search.child_validity(run.record.expansions, run.width) for run in cell.runs)
    return sum(parts, Rate(0, 0)).value


def _passes(cell: Cell) -> Rate | None:
    scores = Scores.of(cell.candidates)
    return _some(Rate(sum(score >= 1 for score in scores.valid), len(scores.all)))


def _some(rate: Rate) -> Rate | None:
    return rate if rate.of else None


def _mean(cell: Cell) -> Value:
    return cell.scores.mean_valid


METRICS: Registry[Metric] = Registry(
    "metric",
    "agentflow.metrics",
    {
        "valid": Metric(
            lambda cell: _some(after_retries(cell.candidates)),
            "trajectories with a valid machine after the retries",
        ),
        "mean": Metric(_mean, "mean score over valid machines"),
        "mean_all": Metric(
            lambda cell: cell.scores.mean_all, "mean score over all machines, invalid = 0"
        ),
        "max": Metric(lambda cell: cell.scores.max, "best score"),
        "std": Metric(
            lambda cell: cell.scores.std, "standard deviation over valid machines (population)"
        ),
        "file_valid": Metric(
            lambda cell: _some(first_attempts(cell.candidates).parse),
            "first attempts in the demanded format",
        ),
        "spatial_valid": Metric(
            lambda cell: _some(first_attempts(cell.candidates).spatial),
            "first attempts that were also free of overlaps and within size",
        ),
        "machine_valid": Metric(
            lambda cell: _some(first_attempts(cell.candidates).machine),
            "first attempts that were valid in every respect",
        ),
        "avg_expansions_per_round": Metric(
            lambda cell: search.expansions_per_round(cell.expansions),
            "new machines per search of one trajectory, all its rounds together",
        ),
        "avg_retry": Metric(
            lambda cell: search.attempts_per_child(cell.expansions),
            "refiner calls per valid child",
        ),
        "validity_rate": Metric(
            _child_rate, "children that came, with all retries, of those wanted", percent=True
        ),
        "pass_of_50": Metric(_passes, "attempts that passed: a score of at least 1"),
    },
    instance_of(Metric),
)


def check_metrics(names: Iterable[str]) -> None:
    """Raises UnknownNameError unless all metrics exist."""
    for name in names:
        METRICS[name]


def curve(runs: Iterable[Member], expansions: int) -> float | None:
    """Mean over all searches of their best score after so many new machines each.

    None where the longest search made fewer; a search that ended earlier keeps its last score.
    """
    items = list(runs)
    longest = max((node.id for run in items for node in run.record.nodes), default=0)
    if expansions > longest:
        return None
    found = [
        score
        for run in items
        for score in search.best_after_expansions(run.record, expansions).values()
    ]
    return statistics.fmean(found) if found else None
