"""Cost of runs by role and stage, from the lines of calls.jsonl."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from agentflow.runs.locations import Location

Cost = Callable[[str, Mapping[str, int]], "float | None"]
"""(model, usage) -> money; None if the model has no price."""


def no_price(_model: str, _usage: Mapping[str, int]) -> float | None:
    """The cost of a call to a model without a price."""
    return None


@dataclass(frozen=True)
class Spent:
    """Totals of some calls.

    Tokens are as reported by the endpoint, 0 if it reports none; those of completions include
    reasoning, and `cached` ones are prompt tokens read from its cache. `retries` are those after
    endpoint errors. `seconds` is the sum of latencies; calls overlap, so it is not wall time.
    `money` is in the currency of the prices, and None if any call has no price.
    """

    calls: int = 0
    prompt: int = 0
    completion: int = 0
    reasoning: int = 0
    cached: int = 0
    retries: int = 0
    seconds: float = 0.0
    money: float | None = 0.0

    @property
    def tokens(self) -> int:
        """Prompt and completion tokens."""
        return self.prompt + self.completion

    @classmethod
    def total(cls, parts: Iterable[Spent]) -> Spent:
        """The sum of one or more."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        sums: list[Any] = [None if None in column else sum(column) for column in columns]
        return cls(*sums)

    def __add__(self, other: Spent) -> Spent:
        return Spent.total((self, other))


def spent_on(call: Mapping[str, Any], cost: Cost = no_price) -> Spent:
    """Cost of one line of calls.jsonl."""
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
class UsageSummary:
    """Cost of a run in total, by role and by stage, in order of first call."""

    total: Spent
    roles: Mapping[str, Spent]
    stages: Mapping[str, Spent]

    @property
    def token_shares(self) -> dict[str, float]:
        """Role -> its share of all tokens; empty if no tokens are reported."""
        whole = self.total.tokens
        return {role: item.tokens / whole for role, item in self.roles.items()} if whole else {}

    def __add__(self, other: UsageSummary) -> UsageSummary:
        return UsageSummary(
            self.total + other.total,
            _add_by_key(self.roles, other.roles),
            _add_by_key(self.stages, other.stages),
        )


def _add_by_key(one: Mapping[str, Spent], other: Mapping[str, Spent]) -> dict[str, Spent]:
    return {key: one.get(key, Spent()) + other.get(key, Spent()) for key in {**one, **other}}


def summarize_usage(
    calls: Iterable[Mapping[str, Any]],
    cost: Cost = no_price,
    stage_of: Callable[[str, str], str] | None = None,
) -> UsageSummary:
    """Add up the lines of calls.jsonl, by stage if given `stage_of` (role, purpose -> stage)."""
    roles: dict[str, list[Spent]] = {}
    stages: dict[str, list[Spent]] = {}
    for call in calls:
        spent = spent_on(call, cost)
        role = call["request"]["role"]
        roles.setdefault(role, []).append(spent)
        if stage_of is not None:
            stage = stage_of(role, Location.parse(call["request"]["label"]).purpose)
            stages.setdefault(stage, []).append(spent)
    by_role, by_stage = (
        {name: Spent.total(parts) for name, parts in found.items()} for found in (roles, stages)
    )
    return UsageSummary(sum(by_role.values(), Spent()), by_role, by_stage)
