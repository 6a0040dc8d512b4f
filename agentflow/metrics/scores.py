"""Statistics of a set of scored machines."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from agentflow.metrics.best import best_at_powers
from agentflow.metrics.intervals import Interval, bootstrap_mean
from agentflow.runs.events import CandidateEvent


@dataclass(frozen=True)
class Scores:
    """Scores of candidates, in the unit of their task.

    Machines whose simulation crashed or timed out are not counted.
    """

    valid: tuple[float, ...]
    """Scores of the valid machines."""
    invalid: int
    """Number of invalid candidates; each counts as 0 in `all`."""

    @classmethod
    def of(cls, candidates: Iterable[CandidateEvent]) -> Scores:
        """Take the scores from candidates."""
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
        return _mean(self.valid)

    @property
    def mean_all(self) -> float | None:
        """Mean over all candidates, invalid = 0; None if there are none."""
        return _mean(self.all)

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
        return best_at_powers(self.all)


def _mean(values: Sequence[float]) -> float | None:
    return statistics.fmean(values) if values else None
