"""The knobs of requirements, which every family has."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from pydantic import Field, field_validator

from agentflow.env.tasks.base import Parameters
from agentflow.machine.blocks.library import library
from agentflow.machine.requirements import (
    NONE,
    Mode,
    Requirement,
    Requirements,
    contradiction,
    usual_prices,
)


class RequirementKnobs(Parameters):
    """What machines must keep besides the task, such as a greatest mass."""

    wanted: tuple[str, ...] = Field(
        (),
        description="requirements, each a quantity, a relation and a value",
        json_schema_extra={"unit": "a list such as mass <= 60 kg, safety >= 1.5"},
    )
    mode: Mode = Field(
        "must",
        description="must: the score counts only if all are met; report: they are only told",
        json_schema_extra={"unit": "must or report"},
    )
    prices: tuple[tuple[int, float], ...] = Field(
        (),
        description="prices that differ from the usual ones",
        json_schema_extra={"unit": "block type: credits"},
    )

    @field_validator("wanted", mode="before")
    @classmethod
    def _read(cls, value: Any) -> Any:
        """Requirements as they are written best, in a list; text may hold several."""
        listed = value.split(",") if isinstance(value, str) else value
        if not isinstance(listed, list | tuple):
            return value
        items = [Requirement.parse(str(item)) for item in listed]
        if fault := contradiction(items):
            raise ValueError(fault)
        return tuple(dict.fromkeys(map(str, items)))

    @field_validator("prices", mode="before")
    @classmethod
    def _pair(cls, value: Any) -> Any:
        """Pairs of a mapping, as knobs are hashed."""
        return tuple(value.items()) if isinstance(value, Mapping) else value

    @field_validator("prices")
    @classmethod
    def _check(cls, prices: tuple[tuple[int, float], ...]) -> tuple[tuple[int, float], ...]:
        for kind, price in prices:
            if kind not in library():
                raise ValueError(f"{kind} is not a block type; see: agentflow blocks")
            if not (isfinite(price) and price >= 0):
                raise ValueError(
                    f"the price of {library()[kind].label} is {price:g} credits; it must not be "
                    "negative"
                )
        return prices

    @property
    def all(self) -> Requirements:
        """The requirements with all prices."""
        if not self.wanted:
            return NONE
        items = tuple(map(Requirement.parse, self.wanted))
        return Requirements(items, self.mode, {**usual_prices(), **dict(self.prices)})
