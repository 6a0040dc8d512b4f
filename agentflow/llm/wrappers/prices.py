"""Token prices. None are built in, because they would go out of date."""

from __future__ import annotations

from pydantic import BaseModel, Field

from agentflow.llm.messages import Usage

_MILLION = 1_000_000


class Price(BaseModel, frozen=True, extra="forbid"):
    """Prices of one model per million tokens, in the currency of the budget."""

    input: float = Field(ge=0)
    """Price of prompt tokens."""
    output: float = Field(ge=0)
    """Price of completion tokens, including reasoning."""
    cached: float | None = Field(default=None, ge=0)
    """Price of cached prompt tokens; None uses the price of other prompt tokens."""

    def of(self, usage: Usage) -> float:
        """Cost of one call; prompt tokens include cached ones."""
        cached = min(usage.cached, usage.prompt)
        rate = self.input if self.cached is None else self.cached
        spent = (usage.prompt - cached) * self.input + cached * rate
        return (spent + usage.completion * self.output) / _MILLION


FREE = Price(input=0.0, output=0.0)
"""Price of models that run in this process."""
