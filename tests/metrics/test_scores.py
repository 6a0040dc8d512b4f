"""Scores of candidates, by hand."""

from __future__ import annotations

import pytest

from agentflow.metrics.cells import Scores
from agentflow.runs.record import RunRecord
from tests.metrics.events import candidate


def test_valid_and_all_are_two_things() -> None:
    record = RunRecord.of(
        [
            candidate("initial", 1, 4.0),
            candidate("initial", 2, 2.0),
            candidate("initial", 3, 0.5, valid=False),
            candidate("initial", 4, None),  # simulated, and the computer failed at it
        ]
    )
    scores = Scores.of(record.of_stage("initial"))
    assert (scores.valid, scores.invalid, scores.all) == ((4.0, 2.0), 1, (4.0, 2.0, 0.0))
    assert (scores.mean_valid, scores.mean_all, scores.max, scores.std) == (3.0, 2.0, 4.0, 1.0)
    assert scores.best_at() == {1: 2.0, 2: pytest.approx(10 / 3)}


def test_nothing_valid_has_no_mean_but_a_mean_over_all() -> None:
    scores = Scores((), 3)
    assert (scores.mean_valid, scores.mean_all, scores.max, scores.std) == (None, 0.0, None, None)
    assert scores.mean_valid_interval() is None
    assert scores.mean_all_interval() == (0.0, 0.0)


def test_nothing_at_all() -> None:
    scores = Scores.of([])
    assert (scores.mean_valid, scores.mean_all, scores.best_at()) == (None, None, {})


def test_the_deviation_is_the_populations() -> None:
    """As published for lifting: counts of ten with mean 9.8, maximum 10, deviation 0.40."""
    scores = Scores((9.0, 10.0, 10.0, 10.0, 10.0), 0)
    assert scores.mean_valid == 9.8
    assert scores.std == pytest.approx(0.40)


def test_intervals_hold_their_mean() -> None:
    scores = Scores((1.0, 2.0, 6.0), 2)
    valid, every = scores.mean_valid_interval(), scores.mean_all_interval()
    assert valid is not None
    assert every is not None
    assert valid.low <= 3.0 <= valid.high
    assert every.low <= 1.8 <= every.high
