"""Owns how much may be spent on a run's calls, whichever client makes them."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import BaseModel, ConfigDict, Field

from agentflow.errors import BudgetSpentError
from agentflow.llm.client import Client
from agentflow.llm.messages import CHARS_PER_TOKEN, Reply, Request, Usage
from agentflow.llm.wrappers.prices import Price


class BudgetSettings(BaseModel):
    """The most that a run may spend; None is no limit."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    calls: int | None = Field(default=None, ge=1)
    tokens: int | None = Field(default=None, ge=1)
    """Prompt and completion tokens together."""
    money: float | None = Field(default=None, gt=0)
    """In the currency of the prices; every model asked must have one."""


class Budget:
    """What is spent and what may be; one object for all clients of a run.

    A resumed run counts what its record holds (`count`) before it begins, and is never refused a
    call that is recorded, so that it stops where the uninterrupted one stops. Where an endpoint
    reports no tokens the limits hold for an estimate from the texts, which is never shown as usage
    or cost.
    """

    def __init__(self, settings: BudgetSettings | None = None) -> None:
        self._settings = settings or BudgetSettings()
        self.calls = 0
        """Calls begun."""
        self.usage = Usage()
        """Tokens of the calls that are answered, as reported."""
        self.cost: float | None = 0.0
        """Of those calls; None as soon as one has no price or no reported tokens."""
        self._tokens = 0
        self._money = 0.0

    def begin(self) -> None:
        """Count one call.

        Raises:
            BudgetSpentError: No call, no token or no money is left.
        """
        for unit, spent, limit in (
            ("calls", self.calls, self._settings.calls),
            ("tokens", self._tokens, self._settings.tokens),
            ("in money", self._money, self._settings.money),
        ):
            if limit is not None and spent >= limit:
                raise BudgetSpentError(f"the budget of {limit} {unit} is spent")
        self.calls += 1

    def count(self, request: Request, reply: Reply, price: Price | None) -> None:
        """Count a call of the record, made by an earlier process."""
        self.calls += 1
        self.add(request, reply, price)

    def add(self, request: Request, reply: Reply, price: Price | None) -> None:
        """Count tokens and money of an answered call."""
        usage = reply.usage
        counted = usage if usage.total else _estimate(request, reply)
        self.usage += usage
        self._tokens += counted.total
        cost = price.of(counted) if price is not None else None
        self._money += cost or 0.0
        if cost is None or (cost and not usage.total) or self.cost is None:
            self.cost = None
        else:
            self.cost += cost


class BudgetClient:
    """Refuses calls once the budget is spent; calls already in flight end normally.

    Args:
        inner: The client whose calls are counted.
        budget: Shared by all clients of the run.
        price: Of the inner client's model; None is unknown.
        recorded: Whether the record holds a request; such a call costs nothing any more.
    """

    def __init__(
        self,
        inner: Client,
        budget: Budget,
        price: Price | None = None,
        recorded: Callable[[Request], bool] = lambda _request: False,
    ) -> None:
        self._inner = inner
        self._budget = budget
        self._price = price
        self._recorded = recorded

    @property
    def name(self) -> str:
        """The model's name."""
        return self._inner.name

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`."""
        if self._recorded(request):
            return await self._inner.complete(request)
        self._budget.begin()
        reply = await self._inner.complete(request)
        self._budget.add(request, reply, self._price)
        return reply

    async def aclose(self) -> None:
        """Close the inner client."""
        await self._inner.aclose()


def _estimate(request: Request, reply: Reply) -> Usage:
    """Token counts from text lengths."""
    return Usage(
        prompt=request.estimated_tokens,
        completion=-(-len(reply.text + reply.reasoning) // CHARS_PER_TOKEN),
    )
