"""Intervals: the formula by hand, the published values, degenerate samples."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.metrics.intervals import (
    Interval,
    Rate,
    bootstrap_mean,
    bootstrap_pairs,
    missing_scipy,
    wilson,
)
from tests.processes import run_python

Z = 1.959963984540054
"""97.5 % point of the normal distribution."""


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_is_scipys(counts: tuple[int, int]) -> None:
    from scipy.stats import binomtest  # a second, which only the worker of these tests should pay

    found = binomtest(*counts).proportion_ci(method="wilson")
    assert wilson(*counts) == pytest.approx((found.low, found.high), abs=1e-12)


@pytest.mark.parametrize(
    ("successes", "low", "high"),
    [(46, 81.2, 96.8), (40, 67.0, 88.8), (41, 69.2, 90.2), (28, 42.3, 68.8), (9, 9.8, 30.8)],
)
def test_wilson_gives_the_published_intervals(successes: int, low: float, high: float) -> None:
    """`validity_ci95` of table post_training_ci in the published results."""
    found = wilson(successes, 50)
    assert found is not None
    assert (round(100 * found.low, 1), round(100 * found.high, 1)) == (low, high)


def test_wilson_is_a_share_where_rounding_would_leave_it() -> None:
    for trials in range(1, 200):
        none, all_ = wilson(0, trials), wilson(trials, trials)
        assert none is not None
        assert all_ is not None
        assert 0 <= none.low < none.high < 1
        assert 0 < all_.low < all_.high <= 1


def test_wilson_of_nothing_and_of_impossible_counts() -> None:
    assert wilson(0, 0) is None
    with pytest.raises(ValueError, match="successes must be 0 to 3, not 4"):
        wilson(4, 3)


def test_bootstrap_is_seeded_and_surrounds_the_mean() -> None:
    values = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0]
    found = bootstrap_mean(values)
    assert found is not None
    assert found == bootstrap_mean(values)
    assert found != bootstrap_mean(values, seed=1)
    assert 0 < found.low < sum(values) / len(values) < found.high < 16


def test_bootstrap_of_two_values_by_hand() -> None:
    """Resamples of {0, 1} average 0, 1/2, 1/2 or 1, a quarter each: 2.5 % lies at 0, 97.5 at 1."""
    assert bootstrap_mean([0.0, 1.0]) == Interval(0.0, 1.0)


def test_bootstrap_comes_near_the_normal_interval_of_a_large_sample() -> None:
    values = [float(i % 10) for i in range(1000)]
    found = bootstrap_mean(values)
    reach = Z * sqrt(8.25 / 1000)
    assert found == pytest.approx((4.5 - reach, 4.5 + reach), abs=0.02)


@pytest.mark.parametrize("value", [0.0, 3.25])
def test_bootstrap_of_equal_values_has_no_width(value: float) -> None:
    assert bootstrap_mean([value] * 8) == Interval(value, value)


@pytest.mark.parametrize("values", [[], [5.0]])
def test_bootstrap_of_fewer_than_two_values_is_none(values: list[float]) -> None:
    assert bootstrap_mean(values) is None


def test_without_scipy_there_is_none_and_the_extra_to_install_is_named(
    without: Callable[[str], None],
) -> None:
    assert missing_scipy() == ""
    without("scipy")
    assert bootstrap_mean([1.0, 2.0]) is None
    assert missing_scipy() == (
        "Intervals of means are left out because scipy is not installed: "
        "pip install 'agentflow-machines[report]'"
    )


def test_no_metric_imports_scipy_before_it_is_needed() -> None:
    code = (
        "import sys, agentflow.metrics.cells, agentflow.metrics.cells\n"
        "print('scipy' in sys.modules)"
    )
    assert run_python("-c", code).stdout == "False\n"


def test_pairs_are_resampled_by_what_they_join() -> None:
    """Three things in a row: resamples that hold two or three of them, by hand.

    Of 27 draws, 3 hold one thing and are left out, 6 hold all three, with the mean 4/3, and 18 hold
    two: 12 at distance 1, 6 at distance 2. So a half of the means are 1, and a quarter are 2.
    """
    matrix = np.array([[9.0, 1, 2], [1, 9, 1], [2, 1, 9]])
    assert bootstrap_pairs(matrix) == Interval(1.0, 2.0)
    assert bootstrap_pairs(matrix[:2, :2]) is None
    assert bootstrap_pairs(np.full((5, 5), 3.0)) == Interval(3.0, 3.0)


@pytest.mark.slow
def test_intervals_of_pairs_are_seeded_and_cover_the_true_mean() -> None:
    """Distances of points from a normal distribution, whose mean is 2 / sqrt(pi)."""
    rng, covered = np.random.default_rng(0), 0
    for _ in range(40):
        points = rng.normal(size=20)
        found = bootstrap_pairs(np.abs(points[:, None] - points))
        assert found is not None
        covered += found.low <= 2 / sqrt(pi) <= found.high
    assert 34 <= covered < 40
    assert found == bootstrap_pairs(np.abs(points[:, None] - points))
    assert found != bootstrap_pairs(np.abs(points[:, None] - points), seed=1)


def test_rates_add_up_and_know_their_interval() -> None:
    rate = Rate(3, 8) + Rate(2, 2)
    assert (rate, rate.value) == (Rate(5, 10), 0.5)
    assert rate.interval == pytest.approx((0.2366, 0.7634), abs=1e-4)
    assert (Rate(0, 0).value, Rate(0, 0).interval) == (None, None)
