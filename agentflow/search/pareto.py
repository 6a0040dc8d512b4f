"""Comparison of candidates on several objectives at once, each to be maximised."""

from __future__ import annotations

from collections.abc import Sequence

Point = tuple[float, ...]
"""The values of one candidate; () if it fails, so that every other one dominates it."""


def dominates(one: Point, other: Point) -> bool:
    """Whether a point is at least as good in every objective, and better in one."""
    if not (one and other):
        return bool(one)
    return one != other and all(a >= b for a, b in zip(one, other, strict=True))


def ranks(points: Sequence[Point]) -> list[int]:
    """The number of each point's front, from 1: fronts of points that only earlier ones dominate.

    This is non-dominated sorting (Deb et al. 2002, "A fast and elitist multiobjective genetic
    algorithm: NSGA-II", IEEE Transactions on Evolutionary Computation 6(2), section III.A), without
    its bookkeeping, because searches have few nodes.
    """
    found = [0] * len(points)
    left, front = list(range(len(points))), 0
    while left:
        front += 1
        first = [i for i in left if not any(dominates(points[j], points[i]) for j in left)]
        for i in first:
            found[i] = front
        left = [i for i in left if not found[i]]
    return found
