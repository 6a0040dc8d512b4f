"""Owns Best@N: what the best of N samples scores on average, exactly."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, fsum


def best_at(scores: Sequence[float], n: int) -> float:
    """The mean, over all subsets of `n` of the scores, of their maximum (spec 6.2).

    Not resampled: in ascending order the i-th of m scores (from 1) is the maximum of C(i-1, n-1)
    of the C(m, n) subsets. With scores of 0 and 1 this is the unbiased pass@k of M. Chen et al.,
    "Evaluating large language models trained on code" (2021).

    Args:
        scores: One per sample; invalid samples count as 0.
        n: Size of the subsets, 1 to the number of scores.

    Raises:
        ValueError: `n` is out of range.
    """
    if not 1 <= n <= len(scores):
        raise ValueError(f"n must be 1 to {len(scores)}, the number of scores, not {n}")
    subsets = comb(len(scores), n)
    ordered = enumerate(sorted(scores))
    return fsum(score * (comb(index, n - 1) / subsets) for index, score in ordered)


def best_at_powers(scores: Sequence[float]) -> dict[int, float]:
    """Best@N for N = 1, 2, 4, ... up to the number of scores."""
    return {1 << power: best_at(scores, 1 << power) for power in range(len(scores).bit_length())}
