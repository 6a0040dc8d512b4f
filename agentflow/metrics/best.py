"""Best@N: the exact expected maximum score of N samples."""

from __future__ import annotations

from collections.abc import Sequence
from math import fsum


def best_at(scores: Sequence[float], n: int) -> float:
    """The mean, over all subsets of `n` of the scores, of their maximum.

    No resampling: in ascending order, the i-th of m scores (from 1) is the maximum of C(i-1, n-1)
    of the C(m, n) subsets. From the highest score down, the shares are n/m and then (i-n)/(i-1)
    times the previous one. With scores of 0 and 1 this is the unbiased pass@k of M. Chen
    et al., "Evaluating large language models trained on code" (2021).

    Args:
        scores: One per sample; invalid samples count as 0.
        n: Subset size, from 1 to the number of scores.

    Raises:
        ValueError: `n` is out of range.
    """
    count = len(scores)
    if not 1 <= n <= count:
        raise ValueError(f"n must be 1 to {count}, the number of scores, not {n}")
    share, parts = n / count, []
    for rank, score in zip(range(count, n - 1, -1), sorted(scores, reverse=True), strict=False):
        parts.append(score * share)
        share *= (rank - n) / (rank - 1) if rank > 1 else 0.0
    return fsum(parts)


def best_at_powers(scores: Sequence[float]) -> dict[int, float]:
    """Best@N for N = 1, 2, 4, ... up to the number of scores."""
    return {1 << power: best_at(scores, 1 << power) for power in range(len(scores).bit_length())}
