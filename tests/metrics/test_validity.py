"""Shares of what is valid, by hand."""

from __future__ import annotations

import pytest

from agentflow.metrics.validity import Rate, after_retries, first_attempts
from agentflow.runs.record import RunRecord
from tests.metrics.events import candidate


def test_first_attempts_and_after_retries() -> None:
    stage = RunRecord.of(
        [
            candidate("initial", 1, 1.0, first="psv"),
            candidate("initial", 2, 1.0, first="ps"),
            candidate("initial", 3, 1.0, first="p"),
            candidate("initial", 4, None, valid=False, first=""),
        ]
    ).of_stage("initial")
    assert str(first_attempts(stage, "parsed")) == "3/4"
    assert str(first_attempts(stage, "spatial")) == "2/4"
    assert str(first_attempts(stage, "valid")) == "1/4"
    assert after_retries(stage) == Rate(3, 4)


def test_rates_add_up_and_know_their_interval() -> None:
    rate = Rate(3, 8) + Rate(2, 2)
    assert (rate, rate.value) == (Rate(5, 10), 0.5)
    assert rate.interval == pytest.approx((0.2366, 0.7634), abs=1e-4)
    assert (Rate(0, 0).value, Rate(0, 0).interval) == (None, None)
