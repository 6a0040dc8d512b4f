"""Shares and 95 % intervals: Wilson's for shares, the bootstrap for means.

The bootstrap needs scipy, an extra; without it there are no intervals of means (`missing_scipy`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from agentflow.extras import install, is_installed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

CONFIDENCE = 0.95
ENDS = ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)
"""Quantiles at the ends of an interval."""
RESAMPLES = 10_000
"""Resamples of a bootstrap; the usual number for percentile intervals."""
POWER = 0.8
"""Share of experiments in which `seeds_needed` shows a difference; the usual one."""
BATCH = 1_000_000
"""Numbers drawn at once, to bound memory."""


class Interval(NamedTuple):
    """Ends of a confidence interval, in the unit of its quantity."""

    low: float
    high: float


@dataclass(frozen=True)
class Rate:
    """A share, as `count` of `of`."""

    count: int
    of: int

    @property
    def value(self) -> float | None:
        """From 0 to 1; None if `of` is 0."""
        return self.count / self.of if self.of else None

    @property
    def interval(self) -> Interval | None:
        """Wilson's 95 % interval."""
        return wilson(self.count, self.of)

    def to_json(self) -> dict[str, Any]:
        """The share with its interval as JSON data."""
        return {"count": self.count, "of": self.of, "share": self.value, "interval": self.interval}

    def __add__(self, other: Rate) -> Rate:
        return Rate(self.count + other.count, self.of + other.of)

    def __str__(self) -> str:
        return f"{self.count}/{self.of}"


def wilson(successes: int, trials: int) -> Interval | None:
    """Wilson's 95 % score interval of a share, without continuity correction.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", Journal of
    the American Statistical Association 22 (1927).

    Returns:
        Shares from 0 to 1; None without trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"successes must be 0 to {trials}, not {successes}")
    if not trials:
        return None
    from statistics import NormalDist  # slow to import, and every command needs the table formats

    share, z = successes / trials, NormalDist().inv_cdf(ENDS[1])
    middle = share + z * z / (2 * trials)
    reach = z * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    return Interval(max(0.0, (middle - reach) / scale), min(1.0, (middle + reach) / scale))


def bootstrap_mean(values: Sequence[float], seed: int = 0) -> Interval | None:
    """The 95 % bootstrap interval of a mean: percentiles over 10,000 seeded resamples.

    B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 7 (1979);
    computed by `scipy.stats.bootstrap`. Equal values (such as all 0) give an empty interval.

    Returns:
        Ends in the unit of the values; None for fewer than two values or without scipy.
    """
    return bootstrap_clusters([(value,) for value in values], seed)


def bootstrap_clusters(groups: Iterable[Sequence[float]], seed: int = 0) -> Interval | None:
    """`bootstrap_mean` of all values, where whole groups are resampled.

    Values of one group, such as the machines of one run, are not independent of one another.

    Returns:
        Ends in the unit of the values; None for fewer than two groups with values or without scipy.
    """
    sums = tuple((sum(group), len(group)) for group in groups if group)
    return _bootstrap(sums, seed) if len(sums) > 1 and is_installed("scipy") else None


@lru_cache(maxsize=200)
def _bootstrap(sums: tuple[tuple[float, int], ...], seed: int) -> Interval | None:
    import numpy as np
    from scipy import stats

    totals, counts = np.asarray(sums, dtype=np.float64).T
    found = stats.bootstrap(
        (totals, counts),
        lambda total, count, axis: total.sum(axis=axis) / count.sum(axis=axis),
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        paired=True,
        rng=np.random.default_rng(seed),
        batch=max(1, BATCH // len(sums)),
        vectorized=True,
    ).confidence_interval
    return Interval(float(found.low), float(found.high))


def seeds_needed(differences: Sequence[float]) -> int | None:
    """About how many pairs show that a mean difference like theirs is not 0.

    So many that the 95 % interval of the mean leaves out 0 in four of five experiments, if these
    differences have the true mean and deviation (normal approximation; J. Cohen, "Statistical power
    analysis for the behavioral sciences", 1988).

    Returns:
        At least 2; None for fewer than two differences, or if their mean is 0.
    """
    from statistics import NormalDist, fmean, stdev

    if len(differences) < 2 or not (mean := fmean(differences)):
        return None
    reach = NormalDist().inv_cdf(ENDS[1]) + NormalDist().inv_cdf(POWER)
    return max(2, math.ceil((reach * stdev(differences) / mean) ** 2))


def bootstrap_pairs(matrix: NDArray[np.float64], seed: int = 0) -> Interval | None:
    """The 95 % bootstrap interval of a mean over all pairs of things, such as their distances.

    Things are resampled, not pairs, because the pairs of one thing are not independent. A pair of a
    thing with a copy of itself does not count; a resample of copies of one thing has no pairs and
    is left out. The ends are percentiles over 10,000 seeded resamples.

    Args:
        matrix: Symmetric, (things, things); the diagonal does not matter.
        seed: Of the resamples.

    Returns:
        Ends in the unit of the matrix; None for fewer than three things.
    """
    count = len(matrix)
    if count < 3:
        return None
    import numpy as np

    others = matrix * (1 - np.eye(count))
    times = np.random.default_rng(seed).multinomial(count, [1 / count] * count, RESAMPLES)
    pairs = count**2 - (times**2).sum(axis=1)
    totals = ((times @ others) * times).sum(axis=1)
    low, high = np.quantile(totals[pairs > 0] / pairs[pairs > 0], ENDS)
    return Interval(float(low), float(high))


def bootstrap_band(
    matrix: NDArray[np.float64], seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The 95 % bootstrap intervals of the mean of each column; whole rows are resampled.

    The ends are percentiles over 10,000 seeded resamples, as in `bootstrap_mean`; no scipy is
    needed.

    Args:
        matrix: (runs, columns).
        seed: Of the resamples.

    Returns:
        Lower and upper ends, (columns,) each; None for fewer than two runs.
    """
    count = len(matrix)
    if count < 2:
        return None
    import numpy as np

    times = np.random.default_rng(seed).multinomial(count, [1 / count] * count, RESAMPLES)
    means = (times / count) @ matrix
    low, high = np.quantile(means, ENDS, axis=0)
    return low, high


def missing_scipy(what: str = "Intervals of means") -> str:
    """Why there are no bootstrap intervals, and how to get them; "" if there are.

    Args:
        what: What else needs scipy, if not intervals.
    """
    why = f"are left out because scipy is not installed: {install('report')}"
    return "" if is_installed("scipy") else f"{what} {why}"
