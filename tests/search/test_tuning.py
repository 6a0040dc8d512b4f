"""Tuning by CMA-ES: what is asked, what is best, and what decides it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from agentflow.machine.numbers import NumberAt
from agentflow.search import tuning

NUMBERS = (NumberAt("a", 0.0, 0.0, 10.0), NumberAt("b", 0.5, -1.0, 1.0))
Pair = tuple[float, float]


async def run(
    seed: int, most: int = 60, greatest: float | None = None
) -> tuple[Pair, float | None, list[Pair]]:
    """Look for (4, -0.25); pairs with a negative second number do not fit if the first is small."""
    pytest.importorskip("cma")
    tried: list[Pair] = []

    def build(values: Sequence[float]) -> Pair | None:
        a, b = (round(value, 3) for value in values)
        assert 0 <= a <= 10
        assert -1 <= b <= 1
        return None if a < 0.1 and b < 0 else (a, b)

    async def judge(pairs: Sequence[Pair], generation: int) -> list[float | None]:
        assert generation > 0
        tried.extend(pairs)
        np.random.seed(0)  # what others do with NumPy's own generator changes nothing
        return [None if a > 9 else -abs(a - 4) / 10 - abs(b + 0.25) for a, b in pairs]

    start = (0.0, 0.5)
    best, score = await tuning.tune(
        tuning.Cma(NUMBERS, seed), build, judge, start, -1.15, most, greatest
    )
    return best, score, tried


@pytest.mark.slow
async def test_the_best_is_found_within_the_budget_and_by_the_seed() -> None:
    best, score, tried = await run(1)
    assert score is not None
    assert score > -0.2
    assert best in tried
    assert len(tried) == len(set(tried)) == 60
    assert await run(1) == (best, score, tried)
    assert (await run(2))[2] != tried


async def test_a_greatest_score_or_no_budget_ends_it() -> None:
    assert (await run(1, most=0))[::2] == ((0.0, 0.5), [])
    assert (await run(1, greatest=-1.15))[2] == []


def test_bounds_that_tell_nothing_are_drawn_around_the_value() -> None:
    low, high = -1e6, 1e6
    assert tuning._bounds(NumberAt("p", 5.0, low, high)) == (-10.0, 20.0)
    assert tuning._bounds(NumberAt("p", 0.0, 0.0, high)) == (0.0, 1.0)
