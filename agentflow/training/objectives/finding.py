"""What function tests have in common: thresholds as written in YAML, and measured values."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from typing import Annotated, NamedTuple

from pydantic import BaseModel, Field

from agentflow.env.feedback.text import thing_name
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import ROOT
from agentflow.training.objectives.motion import Direction, Motion

Body = int | str
"""A block type, of which the block that does best counts, or the name of an object of the scene."""
Amount = Annotated[float, Field(gt=0)]
Asked = Annotated[float, Field(ge=0)]
"""A threshold that asks nothing while it is 0."""
Count = Annotated[int, Field(ge=1)]


class Finding(NamedTuple):
    """A measured value and its threshold, which is inclusive."""

    value: float
    """0 if there was nothing to measure."""
    limit: float
    unit: str
    most: bool = False
    """Whether the limit is the greatest value that passes, rather than the least one."""

    @property
    def passed(self) -> bool:
        """Whether the value keeps the limit."""
        return self.value <= self.limit if self.most else self.value >= self.limit


Findings = Iterator[tuple[str, Finding]]


class FunctionTest(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Base class of function tests: thresholds, what they mean in words, and how they are measured.

    Frozen, range-checked, no unknown keys.
    """

    @property
    @abstractmethod
    def phrase(self) -> str:
        """What must happen, for designers, to follow "The machine works if"."""

    @abstractmethod
    def measure(self, motion: Motion) -> Findings:
        """What is measured, by the name of its threshold."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Block types that a machine needs to pass, and moving objects that the scene needs."""
        return ()

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Things that the scene needs, whether they move or not."""
        return ()


def name_way(towards: Direction) -> str:
    """A direction in words."""
    return "horizontally" if towards == "any" else f"along {towards}"


def name_body(body: Body) -> str:
    """A block type or object in words."""
    if isinstance(body, str):
        return thing_name(body)
    return f"its {library()[body].name}" if body == ROOT.type else f"a {library()[body].name}"


def reached_by(count: int, values: Sequence[float]) -> float:
    """What at least `count` of the values reach; 0 if there are fewer values."""
    return sorted(values, reverse=True)[count - 1] if len(values) >= count else 0.0
