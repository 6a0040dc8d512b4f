"""Limit the calls, tokens and cost of a run.

No prices are built in, because they would go out of date.
"""

from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, Field

from agentflow.errors import BudgetSpentError
from agentflow.llm.messages import Client, ClientWrapper, Reply, Request, Usage

_MILLION = 1_000_000


class Price(BaseModel, frozen=True, extra="forbid"):
    """Prices of one model per million tokens, in the currency of the budget.

    Attributes:
        input: Price of prompt tokens.
        output: Price of completion tokens, including reasoning.
        cached: Price of cached prompt tokens; None uses the price of other prompt tokens.
    """

    input: float = Field(ge=0)
    output: float = Field(ge=0)
    cached: float | None = Field(None, ge=0)

    def of(self, usage: Usage) -> float:
        """Cost of one call; prompt tokens include cached ones."""
        cached = min(usage.cached, usage.prompt)
        rate = self.input if self.cached is None else self.cached
        spent = (usage.prompt - cached) * self.input + cached * rate
        return (spent + usage.completion * self.output) / _MILLION


FREE = Price(input=0.0, output=0.0)
"""Price of models that run in this process."""


class BudgetSettings(BaseModel, frozen=True, extra="forbid"):
    """Limits of a run; null is no limit.

    Attributes:
        calls: Maximum number of calls.
        tokens: Maximum tokens, prompt and completion together.
        money: Maximum cost, in the currency of the prices; needs a price for every model.
    """

    calls: int | None = Field(None, ge=1)
    tokens: int | None = Field(None, ge=1)
    money: float | None = Field(None, gt=0)


class Budget:
    """Spending of a run against its limits; shared by all clients of the run.

    A resumed run first counts its recorded calls (`count`) and repeats them for free, so it stops
    where an uninterrupted run would. If an endpoint reports no tokens, the limits use an estimate
    from text lengths, which is never reported as usage or cost.
    """

    def __init__(self, settings: BudgetSettings | None = None) -> None:
        self._settings = settings or BudgetSettings()
        self.calls = 0
        """Calls started."""
        self.usage = Usage()
        """Reported tokens of answered calls."""
        self.cost: float | None = 0.0
        """Cost of those calls; None once one has no price or no reported tokens."""
        self._tokens = 0
        self._money = 0.0

    def to_json(self) -> dict[str, Any]:
        """What was used, for results: `calls`, `tokens` and `cost`."""
        cost = None if self.cost is None else round(self.cost, 6)
        return {"calls": self.calls, "tokens": self.usage.total, "cost": cost}

    def begin(self) -> None:
        """Count one call.

        Raises:
            BudgetSpentError: A limit is reached.
        """
        for unit, spent, limit in (
            ("call", self.calls, self._settings.calls),
            ("token", self._tokens, self._settings.tokens),
            ("cost", self._money, self._settings.money),
        ):
            if limit is not None and spent >= limit:
                raise BudgetSpentError(f"{unit} limit reached ({limit})")
        self.calls += 1

    def count(self, request: Request, reply: Reply, price: Price | None) -> None:
        """Count a recorded call, made before the run was resumed."""
        self.calls += 1
        self.add(request, reply, price)

    def add(self, request: Request, reply: Reply, price: Price | None) -> None:
        """Count tokens and cost of an answered call."""
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


class BudgetClient(ClientWrapper):
    """Rejects calls once a limit is reached; calls in progress finish normally.

    Attributes:
        inner: The client whose calls are counted.
        budget: Shared by all clients of the run.
        price: Price of the inner client's model; None if unknown.
        recorded: Whether a request is on record; such calls are free.
    """

    def __init__(
        self,
        inner: Client,
        budget: Budget,
        price: Price | None = None,
        recorded: Callable[[Request], bool] = lambda _request: False,
    ) -> None:
        super().__init__(inner)
        self._budget = budget
        self._price = price
        self._recorded = recorded

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`."""
        if self._recorded(request):
            return await self._inner.complete(request)
        self._budget.begin()
        reply = await self._inner.complete(request)
        self._budget.add(request, reply, self._price)
        return reply


def _estimate(request: Request, reply: Reply) -> Usage:
    return Usage(prompt=request.estimated_tokens, completion=reply.estimated_tokens)
