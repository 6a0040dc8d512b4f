"""Best@N against brute force over all subsets."""

from __future__ import annotations

from itertools import combinations
from statistics import fmean

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.metrics.cells import Scores, best_at

SCORES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=9)


@given(SCORES, st.data())
def test_best_at_is_the_mean_over_all_subsets(scores: list[float], data: st.DataObject) -> None:
    n = data.draw(st.integers(1, len(scores)))
    brute = fmean(max(subset) for subset in combinations(scores, n))
    assert best_at(scores, n) == pytest.approx(brute, rel=1e-9, abs=1e-6)


def test_by_hand() -> None:
    """Of 1, 2, 4: pairs have the maxima 2, 4, 4."""
    assert best_at([4, 1, 2], 2) == pytest.approx(10 / 3)
    assert best_at([4, 1, 2], 1) == pytest.approx(7 / 3)
    assert best_at([4, 1, 2], 3) == 4


def test_thousands_of_scores_do_not_overflow() -> None:
    scores = [float(i) for i in range(5000)]
    assert best_at(scores, 2500) == pytest.approx(2500 * 5001 / 2501 - 1)


def test_powers_end_with_the_number_of_scores() -> None:
    assert list(Scores((1.0,) * 8, 0).best_at()) == [1, 2, 4, 8]
    assert list(Scores((1.0,) * 9, 0).best_at()) == [1, 2, 4, 8]
    assert Scores((), 0).best_at() == {}
    assert Scores((2.5,), 0).best_at() == {1: 2.5}


@pytest.mark.parametrize("n", [0, 4])
def test_impossible_sizes_are_refused(n: int) -> None:
    with pytest.raises(ValueError, match=f"n must be 1 to 3, the number of scores, not {n}"):
        best_at([1, 2, 3], n)
