"""The gates that pairs pass on their way into a set, and what each of them said."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from pydantic import BaseModel, ConfigDict

Gate = Literal[
    "objective",
    "original",
    "parse",
    "validity",
    "evaluation",
    "duplicate",
    "simulation",
    "function",
]
GATES: Mapping[Gate, str] = MappingProxyType(
    {
        "objective": "the objective's text is not too near the brief of a level",
        "original": "it is no variant of a machine that another gate dropped, duplicates apart",
        "parse": "the reply holds a machine",
        "validity": "the machine meets the rules of space and of the task",
        "evaluation": "the machine is in no evaluation run and no record of a level",
        "duplicate": "no earlier machine is the same tree of block types",
        "simulation": "the simulation neither timed out nor crashed",
        "function": "the simulated machine does what the objective asks",
    }
)
"""In their order, cheap ones first: what passes each of them."""


class Judgement(BaseModel):
    """What the gates said about one machine; a line of `judged.jsonl`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    objective: str
    sample: int
    variant: int = 0
    """0 is the machine of the reply, others are its variants."""
    source: str
    dropped: Gate | None = None
    """The gate that did not let it pass; None if it is in the set."""
    why: str = ""
    """Code of the first problem, or names of the function tests that it failed."""
    tree: str = ""
    """Hash of its tree of block types."""
    score: float | None = None
