"""Rank correlation of two series of scores."""

from __future__ import annotations

from collections.abc import Sequence


def rank_correlation(first: Sequence[float], second: Sequence[float]) -> float | None:
    """Spearman's rank correlation coefficient; ties share their mean rank.

    Returns:
        -1 to 1; None if a series has fewer than two different values, or without scipy.
    """
    if len(set(first)) < 2 or len(set(second)) < 2:
        return None
    try:
        from scipy.stats import spearmanr
    except ImportError:
        return None
    return float(spearmanr(first, second).statistic)
