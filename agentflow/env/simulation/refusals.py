"""Rollouts that are refused: invalid machines, rates and intervals out of range."""

from __future__ import annotations

from collections.abc import Sequence

from agentflow.env.constants import Constants, constants
from agentflow.env.rollout import Feedback, Rollout
from agentflow.errors import UsageError
from agentflow.machine.problems import Problem

RATES = (30, 1000)
"""Hz: below them contacts and load windows are not resolved, above them rollouts take too long."""


def checked_timing(
    rate: float | None, interval: float | None, physics: Constants
) -> tuple[float, float]:
    """Steps per second and seconds between samples; those of the constants by default.

    Raises:
        UsageError: `rate` is not within 30 to 1000 Hz, or `interval` not above 0.
    """
    rate = physics["step_rate"] if rate is None else rate
    interval = physics["sample_interval"] if interval is None else interval
    low, high = RATES
    if not low <= rate <= high:
        raise UsageError(f"the rate is {rate:g} Hz; it must be from {low} to {high} Hz")
    if not interval > 0:
        raise UsageError(f"the interval is {interval:g} s; it must be above 0 s")
    return rate, interval


def invalid_rollout(problems: Sequence[Problem], engine: str | None = None) -> Rollout:
    """The result of a machine that is not simulated because of these problems.

    Args:
        problems: Why the machine is invalid.
        engine: The engine that cannot hold it, if that is the reason.
    """
    listed = tuple(problem.to_json() for problem in problems)
    text = "The machine is invalid and was not simulated: " + "; ".join(
        str(problem["message"]) for problem in listed
    )
    return Rollout(
        status="invalid",
        score=0.0,
        terms={},
        problems=listed,
        broken=(),
        events=(),
        feedback=Feedback(text, {"status": "invalid", "problems": list(listed)}),
        trace=None,
        digest=None,
        sim_seconds=None,
        wall_seconds=None,
        constants=constants().digest,
        engine=engine,
    )
