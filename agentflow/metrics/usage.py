"""Owns what runs cost: calls, tokens, money, seconds per role and per stage; rates of simulation.

Works on the lines of calls.jsonl as data, so that any recorded run can be counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from agentflow.metrics.records import stage_of

Cost = Callable[[str, Mapping[str, int]], "float | None"]
"""(model, usage) -> money, or None when the model has no price."""


def unpriced(_model: str, _usage: Mapping[str, int]) -> float | None:
    """No price is known."""
    return None


@dataclass(frozen=True)
class Spent:
    """The sum over some calls."""

    calls: int = 0
    prompt: int = 0
    """Tokens, as the endpoint reports them; 0 where it reports none, as do all below."""
    completion: int = 0
    """Tokens, reasoning included."""
    reasoning: int = 0
    cached: int = 0
    """Prompt tokens that the endpoint had cached."""
    retries: int = 0
    """Repetitions because of faults of the endpoint."""
    seconds: float = 0.0
    """Latencies added up; calls overlap, so this is no wall time."""
    money: float | None = 0.0
    """In the currency of the prices; None as soon as one call has no price."""

    @property
    def tokens(self) -> int:
        """Prompt and completion tokens together."""
        return self.prompt + self.completion

    def __add__(self, other: Spent) -> Spent:
        unknown = self.money is None or other.money is None
        return Spent(
            self.calls + other.calls,
            self.prompt + other.prompt,
            self.completion + other.completion,
            self.reasoning + other.reasoning,
            self.cached + other.cached,
            self.retries + other.retries,
            self.seconds + other.seconds,
            None if unknown else (self.money or 0.0) + (other.money or 0.0),
        )


def spent_on(call: Mapping[str, Any], cost: Cost = unpriced) -> Spent:
    """What one line of calls.jsonl cost."""
    reply = call["reply"]
    usage: Mapping[str, int] = reply["usage"]
    return Spent(
        1,
        usage["prompt"],
        usage["completion"],
        usage["reasoning"],
        usage["cached"],
        reply["retries"],
        reply["latency_s"],
        cost(call["model"], usage),
    )


@dataclass(frozen=True)
class Bill:
    """What a run cost, in total and taken apart; roles and stages in order of their first call."""

    total: Spent
    roles: Mapping[str, Spent]
    stages: Mapping[str, Spent]

    @property
    def token_shares(self) -> dict[str, float]:
        """Role -> its share of all tokens; empty where no tokens are reported."""
        whole = self.total.tokens
        return {role: item.tokens / whole for role, item in self.roles.items()} if whole else {}

    def __add__(self, other: Bill) -> Bill:
        return Bill(
            self.total + other.total,
            _joined(self.roles, other.roles),
            _joined(self.stages, other.stages),
        )


def _joined(one: Mapping[str, Spent], other: Mapping[str, Spent]) -> dict[str, Spent]:
    return {key: one.get(key, Spent()) + other.get(key, Spent()) for key in {**one, **other}}


def bill(calls: Iterable[Mapping[str, Any]], cost: Cost = unpriced) -> Bill:
    """Add up the lines of calls.jsonl; of any length, one at a time."""
    total = Spent()
    roles: dict[str, Spent] = {}
    stages: dict[str, Spent] = {}
    for call in calls:
        spent = spent_on(call, cost)
        role, stage = call["request"]["role"], stage_of(call["request"]["label"])
        total += spent
        roles[role] = roles.get(role, Spent()) + spent
        stages[stage] = stages.get(stage, Spent()) + spent
    return Bill(total, roles, stages)


@dataclass(frozen=True)
class Simulated:
    """How much was simulated, and how fast."""

    rollouts: int
    simulated_seconds: float
    """Of the machines' own time, settling included."""
    worker_seconds: float
    """Wall time that workers were busy with it."""

    @property
    def rollouts_per_second(self) -> float | None:
        """Per worker; None when nothing was simulated."""
        return self.rollouts / self.worker_seconds if self.worker_seconds else None

    @property
    def speed(self) -> float | None:
        """Simulated seconds per worker's second; None when nothing was simulated."""
        return self.simulated_seconds / self.worker_seconds if self.worker_seconds else None

    def __add__(self, other: Simulated) -> Simulated:
        return Simulated(
            self.rollouts + other.rollouts,
            self.simulated_seconds + other.simulated_seconds,
            self.worker_seconds + other.worker_seconds,
        )
