"""Statistics of a set of scored machines."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import fsum

from agentflow.metrics.intervals import Interval, bootstrap_mean
from agentflow.runs.events import CandidateEvent


@dataclass(frozen=True)
class Scores:
    """Scores of candidates in the unit of their task, without crashed or timed-out simulations."""

    valid: tuple[float, ...]
    """Scores of the valid machines."""
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
