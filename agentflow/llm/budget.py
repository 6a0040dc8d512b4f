"""Owns how much may be spent on a run's calls, whichever client makes them."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from agentflow.errors import BudgetSpentError
from agentflow.llm.client import Client
from agentflow.llm.messages import Reply, Request, Usage


class BudgetSettings(BaseModel):
    """The most that a run may spend; None is no limit."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    calls: int | None = Field(default=None, ge=1)
    tokens: int | None = Field(default=None, ge=1)
    """Prompt and completion tokens together."""


class Budget:
    """What is spent and what may be; one object for all clients of a run.

    Calls answered from the record count like others, so that a resumed run stops where the
    uninterrupted one stops.
    """

    def __init__(self, settings: BudgetSettings | None = None) -> None:
        self._settings = settings or BudgetSettings()
        self.calls = 0
        """Calls begun."""
        self.usage = Usage()
        """Tokens of the calls that are answered."""

    def begin(self) -> None:
        """Count one call.

        Raises:
            BudgetSpentError: No call or no token is left.
        """
        for unit, spent, limit in (
            ("calls", self.calls, self._settings.calls),
            ("tokens", self.usage.total, self._settings.tokens),
        ):
            if limit is not None and spent >= limit:
                raise BudgetSpentError(f"the budget of {limit} {unit} is spent")
        self.calls += 1

    def add(self, usage: Usage) -> None:
        """Count the tokens of an answered call."""
        self.usage += usage


class BudgetClient:
    """Refuses calls once the budget is spent; calls already in flight end normally."""

    def __init__(self, inner: Client, budget: Budget) -> None:
        self._inner = inner
        self._budget = budget

    @property
    def name(self) -> str:
        """The model's name."""
        return self._inner.name

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`."""
        self._budget.begin()
        reply = await self._inner.complete(request)
        self._budget.add(reply.usage)
        return reply

    async def aclose(self) -> None:
        """Close the inner client."""
        await self._inner.aclose()
