"""Spearman's rank correlation."""

from __future__ import annotations

import pytest

from agentflow.app.subjects.engines import rank_correlation


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ((10.0, 20.0, 30.0, 40.0), 1.0),
        ((1.0, 10.0, 100.0, 1000.0), 1.0),
        ((4.0, 3.0, 2.0, 1.0), -1.0),
        ((2.0, 1.0, 4.0, 3.0), 0.6),  # 1 - 6 * 4 / (4 * 15)
    ],
)
def test_only_the_order_counts(second: tuple[float, ...], expected: float) -> None:
    assert rank_correlation((1.0, 2.0, 3.0, 4.0), second) == pytest.approx(expected)


def test_equal_scores_share_their_mean_rank() -> None:
    assert rank_correlation((1.0, 2.0, 2.0, 3.0), (5.0, 6.0, 6.0, 9.0)) == pytest.approx(1.0)


@pytest.mark.parametrize("same", [(), (1.0,), (2.0, 2.0, 2.0)])
def test_without_two_different_scores_there_is_none(same: tuple[float, ...]) -> None:
    assert rank_correlation(same, range(len(same))) is None
    assert rank_correlation(range(len(same)), same) is None
