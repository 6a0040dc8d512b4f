"""Owns the numbers of a set of scored machines; which machines belong together is the caller's."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from agentflow.metrics.best import best_at_powers
from agentflow.metrics.intervals import Interval, bootstrap_mean
from agentflow.metrics.records import CandidateRecord


@dataclass(frozen=True)
class Scores:
    """Scores of candidates, in the unit of their task.

    Machines that the computer could not score (a crash, a timeout) are in neither.
    """

    valid: tuple[float, ...]
    """Of the valid machines."""
    invalid: int
    """How many were none; each counts as 0 where all are counted."""

    @classmethod
    def of(cls, candidates: Iterable[CandidateRecord]) -> Scores:
        """The scores of candidates."""
        items = list(candidates)
        scores = tuple(c.score for c in items if c.valid and c.score is not None)
        return cls(scores, sum(not c.valid for c in items))

    @property
    def all(self) -> tuple[float, ...]:
        """With 0 for each invalid one."""
        return self.valid + (0.0,) * self.invalid

    @property
    def mean_valid(self) -> float | None:
        """Mean over the valid machines; None without one."""
        return _mean(self.valid)

    @property
    def mean_all(self) -> float | None:
        """Mean over all, invalid = 0; None without any."""
        return _mean(self.all)

    @property
    def max(self) -> float | None:
        """The best valid score; None without one."""
        return max(self.valid, default=None)

    @property
    def std(self) -> float | None:
        """Standard deviation of the valid scores as a population; None without one.

        The population's, because published values are (mean 9.8, maximum 10, deviation 0.40 of
        counts up to 10).
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
        return best_at_powers(self.all)


def _mean(values: Sequence[float]) -> float | None:
    return statistics.fmean(values) if values else None
