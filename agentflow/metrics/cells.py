"""The numbers in the tables of sweeps, named as in the published tables, and statistics of scored
machines.

A cell holds the runs that one number is computed from; seeds are pooled, not averaged.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from math import fsum
from pathlib import Path
from typing import Literal

from agentflow.machine import Machine
from agentflow.metrics import search
from agentflow.metrics.intervals import Interval, Rate, bootstrap_mean
from agentflow.metrics.machines import recorded_machine
from agentflow.metrics.tables import Value
from agentflow.registry import Registry, instance_of
from agentflow.runs.events import CandidateEvent, ExpandEvent
from agentflow.runs.record import RunRecord


@dataclass(frozen=True)
class Scores:
    """Scores of candidates in the unit of their task, without crashed or timed-out simulations."""

    valid: tuple[float, ...]
    invalid: int
    """Number of invalid candidates; each counts as 0 in `all`."""

    @classmethod
    def of(cls, candidates: Iterable[CandidateEvent]) -> Scores:
        """The scores of candidates."""
        items = list(candidates)
        scores = tuple(c.score for c in items if c.valid and c.score is not None)
        return cls(scores, sum(not c.valid for c in items))

    @property
    def all(self) -> tuple[float, ...]:
        """All scores, with 0 for each invalid candidate."""
        return self.valid + (0.0,) * self.invalid

    @property
    def mean_valid(self) -> float | None:
        """Mean over the valid machines; None if there are none."""
        return mean_known(self.valid)

    @property
    def mean_all(self) -> float | None:
        """Mean over all candidates, invalid = 0; None if there are none."""
        return mean_known(self.all)

    @property
    def max(self) -> float | None:
        """The best valid score; None if there is none."""
        return max(self.valid, default=None)

    @property
    def std(self) -> float | None:
        """Population standard deviation of the valid scores; None if there are none.

        Published deviations are the population's: a mean of 9.8 with a maximum of 10 and a
        deviation of 0.40 is possible for counts up to 10 only that way.
        """
        return statistics.pstdev(self.valid) if self.valid else None

    def mean_valid_interval(self, seed: int = 0) -> Interval | None:
        """95 % bootstrap interval of `mean_valid`; see `bootstrap_mean`."""
        return bootstrap_mean(self.valid, seed)

    def mean_all_interval(self, seed: int = 0) -> Interval | None:
        """95 % bootstrap interval of `mean_all`; see `bootstrap_mean`."""
        return bootstrap_mean(self.all, seed)

    def best_at(self) -> dict[int, float]:
        """Best@N over all, invalid = 0, for N = 1, 2, 4, ...; see `best_at`."""
        scores = self.all
        return {1 << p: best_at(scores, 1 << p) for p in range(len(scores).bit_length())}


def mean_known(values: Iterable[float | None]) -> float | None:
    """The mean of the values that are known; None if none is."""
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def best_at(scores: Sequence[float], n: int) -> float:
    """The mean, over all subsets of `n` of the scores, of their maximum.

    No resampling: in ascending order, the i-th of m scores (from 1) is the maximum of C(i-1, n-1)
    of the C(m, n) subsets. From the highest score down, the shares are n/m and then (i-n)/(i-1)
    times the previous one. With scores of 0 and 1 this is the unbiased pass@k of M. Chen
    et al., "Evaluating large language models trained on code" (2021).
    """
    count = len(scores)
    if not 1 <= n <= count:
        raise ValueError(f"n must be 1 to {count}, the number of scores, not {n}")
    share, parts = n / count, []
    for rank, score in zip(range(count, n - 1, -1), sorted(scores, reverse=True), strict=False):
        parts.append(score * share)
        share *= (rank - n) / (rank - 1) if rank > 1 else 0.0
    return fsum(parts)


@dataclass(frozen=True)
class RunNumbers:
    """The numbers of one finished run that metrics use.

    `width` children are wanted per expansion. `full` is the score that a share of 1 stands for: the
    greatest possible one, or the verified score of the task's record; None if it has neither.
    `path` is the run directory; None for a record alone.
    """

    record: RunRecord
    width: int
    full: float | None = None

    path: Path | None = None

    @property
    def share(self) -> float | None:
        """The best machine's verified score (its plain one if it was not verified) as a share of
        `full`; None without either."""
        check = self.record.verification
        score = self.record.best if check is None else check.score
        return None if score is None or not self.full else score / self.full


@dataclass(frozen=True)
class Cell:
    """Runs, and which of their machines count."""

    runs: tuple[RunNumbers, ...]
    stage: str
    rounds: int | None = None
    """Rounds after which searches are cut off; None for the whole stage."""

    @property
    def candidates(self) -> list[CandidateEvent]:
        """The stage's candidates of all runs."""
        return [item for run in self.runs for item in run.record.of_stage(self.stage)]

    @property
    def machines(self) -> list[Machine]:
        """The machines of the stage's valid candidates, in their order; those of a record alone
        are left out.

        Raises:
            RunError: A machine of a run cannot be read.
        """
        return [
            recorded_machine(run.path, item.machine)
            for run in self.runs
            if run.path is not None
            for item in run.record.of_stage(self.stage)
            if item.valid and item.machine is not None
        ]

    @property
    def expansions(self) -> list[list[ExpandEvent]]:
        """The expansions of each run."""
        return [run.record.expansions for run in self.runs]

    @property
    def scores(self) -> Scores:
        """Scores of the stage's machines, or the best score of each tree after `rounds`."""
        if self.rounds is None:
            return Scores.of(self.candidates)
        found: list[float] = []
        for run in self.runs:
            if search.most_rounds(run.record) >= self.rounds:
                found += search.best_after_rounds(run.record, self.rounds).values()
        return Scores(tuple(found), 0)


@dataclass(frozen=True)
class Metric:
    """How to compute one number of a cell."""

    of: Callable[[Cell], Value]
    about: str
    """Explanation, printed below tables."""
    percent: bool = False
    """Whether to show it as a percentage."""
    digits: int = 2
    """Decimals of its floats."""


def _first_attempts(level: Literal["parsed", "spatial", "valid"]) -> Callable[[Cell], Rate | None]:
    """Trajectories whose first attempt, before any retry, got this far; see `FirstAttempt`."""
    return lambda cell: _share_of([getattr(item.first, level) for item in cell.candidates])


def _share_of(judged: Sequence[bool]) -> Rate | None:
    """How many of the items are true; None without any."""
    return Rate(sum(judged), len(judged)) if judged else None


def _child_rate(cell: Cell) -> float | None:
    parts = (search.child_validity(run.record.expansions, run.width) for run in cell.runs)
    return sum(parts, Rate(0, 0)).value


def _passes(cell: Cell) -> Rate | None:
    return _share_of([score >= 1 for score in Scores.of(cell.candidates).all])


def _verified(cell: Cell) -> float | None:
    found = [run.record.verification for run in cell.runs]
    return mean_known(item.score for item in found if item is not None)


def _successes(cell: Cell) -> Rate | None:
    """Invalid machines fail; those whose simulation crashed or timed out do not count."""
    judged = []
    for run in cell.runs:
        for item in run.record.of_stage(cell.stage):
            if not item.valid or item.score is not None:
                found = run.record.machines.get(item.machine or "") if item.valid else None
                judged.append(bool(found and found.success))
    return _share_of(judged)


def _met(cell: Cell) -> Rate | None:
    """Of all requirements that the machines have, how many are met; invalid machines have none."""
    found = [
        machine.met
        for run in cell.runs
        for item in run.record.of_stage(cell.stage)
        if item.valid and (machine := run.record.machines.get(item.machine or "")) and machine.met
    ]
    return Rate(sum(met for met, _ in found), sum(of for _, of in found)) if found else None


def _success_interval(cell: Cell) -> Interval | None:
    rate = _successes(cell)
    return None if rate is None else rate.interval


METRICS: Registry[Metric] = Registry(
    "metric",
    "agentflow.metrics",
    {
        "valid": Metric(
            lambda cell: _share_of([item.valid for item in cell.candidates]),
            "trajectories (independent attempts) with a valid machine, after retries",
        ),
        "mean": Metric(lambda cell: cell.scores.mean_valid, "mean score over valid machines"),
        "mean_all": Metric(
            lambda cell: cell.scores.mean_all, "mean score over all machines, invalid ones scored 0"
        ),
        "max": Metric(lambda cell: cell.scores.max, "best score"),
        "verified": Metric(
            _verified,
            "mean over runs of the verified score of the run's best machine (of all stages), which "
            "is its median under small variations of physics",
        ),
        "share": Metric(
            lambda cell: mean_known(run.share for run in cell.runs),
            "mean over runs of the verified score of the run's best machine, as a share of the "
            "greatest possible score or, if there is none, of the best known machine's",
            percent=True,
        ),
        "std": Metric(
            lambda cell: cell.scores.std, "population standard deviation over valid machines"
        ),
        "file_valid": Metric(_first_attempts("parsed"), "first attempts in the required format"),
        "spatial_valid": Metric(
            _first_attempts("spatial"),
            "first attempts that also have no overlaps and are within the size limit",
        ),
        "machine_valid": Metric(
            _first_attempts("valid"), "first attempts that are valid in every respect"
        ),
        "avg_expansions_per_round": Metric(
            lambda cell: search.expansions_per_round(cell.expansions),
            "new machines per search, in total over all rounds (named as in the paper)",
        ),
        "avg_retry": Metric(
            lambda cell: search.attempts_per_child(list(chain.from_iterable(cell.expansions))),
            "refiner calls per valid new machine",
        ),
        "validity_rate": Metric(
            _child_rate,
            "share of the requested machines that were obtained, after retries",
            percent=True,
        ),
        "success": Metric(
            _successes,
            "machines that meet the task's criterion of success; those whose simulation crashed or "
            "timed out do not count",
        ),
        "success_95": Metric(
            _success_interval, "Wilson's 95 % interval of success", percent=True, digits=1
        ),
        "met": Metric(_met, "requirements that valid machines meet, of all that they should meet"),
        "pass_of_50": Metric(_passes, "attempts that passed, which means a score of at least 1"),
    },
    instance_of(Metric),
)


def check_metrics(names: Iterable[str]) -> None:
    """Raise UnknownNameError unless all metrics exist."""
    for name in names:
        METRICS[name]


def curve(runs: Iterable[RunNumbers], expansions: int) -> list[list[float]]:
    """The best scores of the searches of each run after this many new machines each.

    Nothing if even the longest search made fewer; a search that ended earlier keeps its last score.
    """
    items = list(runs)
    longest = max(
        (node.location.node or 0 for run in items for node in run.record.nodes), default=0
    )
    if expansions > longest:
        return []
    found = (search.best_after_expansions(run.record, expansions) for run in items)
    return [list(scores.values()) for scores in found]
