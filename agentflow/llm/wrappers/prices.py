"""Owns what tokens cost. No price ships: they change, and a stale one would break a promise."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from agentflow.llm.messages import Usage

_MILLION = 1_000_000


class Price(BaseModel):
    """Price of one model per million tokens, in whatever currency the budget is in."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    input: float = Field(ge=0)
    """Of prompt tokens."""
    output: float = Field(ge=0)
    """Of completion tokens, reasoning included."""
    cached: float | None = Field(default=None, ge=0)
    """Of prompt tokens that the endpoint had cached; None is the price of all others."""

    def of(self, usage: Usage) -> float:
        """The cost of one call; cached tokens are among the prompt tokens."""
        cached = min(usage.cached, usage.prompt)
        rate = self.input if self.cached is None else self.cached
        spent = (usage.prompt - cached) * self.input + cached * rate
        return (spent + usage.completion * self.output) / _MILLION


FREE = Price(input=0.0, output=0.0)
"""Of what runs in this process."""
