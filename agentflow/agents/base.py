"""Owns what a role is and how it is asked: render, call, parse, retry with the reason appended."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

from agentflow.llm.client import Client
from agentflow.llm.messages import Reply, Sampling
from agentflow.prompts.render import PromptSet

In = TypeVar("In")
Out = TypeVar("Out")


@dataclass(frozen=True)
class Parsed(Generic[Out]):
    """What a parser made of a reply: an output, or the problem that goes back to the model."""

    output: Out | None
    problem: str = ""
    """One or two plain sentences that the model can act on; empty when there is an output."""
    code: str = ""
    """Machine-readable kind of the problem, for counting: unparsable, overlap, ..."""
    repaired: bool = False
    parsed: bool = True
    """Whether the reply had the demanded format at all."""
    spatial: bool | None = None
    """Spatial validity of the machine in it; None where there is no machine to judge."""


@dataclass(frozen=True)
class Attempt(Generic[Out]):
    """One call of a role and what came of it; recorded whatever it is."""

    role: str
    label: str
    reply: Reply
    parsed: Parsed[Out]


@dataclass(frozen=True)
class Outcome(Generic[Out]):
    """All attempts of one question; `output` is None when every one failed (a recorded result)."""

    output: Out | None
    attempts: tuple[Attempt[Out], ...]

    @property
    def valid_at_first(self) -> bool:
        """Whether the first attempt already gave the output."""
        return bool(self.attempts) and self.attempts[0].parsed.output is not None


class Role(ABC, Generic[In, Out]):
    """A template pair and a parser. Roles hold no state."""

    name: ClassVar[str]
    """Folder of its templates and value of `Request.role`."""

    @abstractmethod
    def variables(self, given: In) -> Mapping[str, object]:
        """What the templates may use."""

    @abstractmethod
    def parse(self, text: str, given: In) -> Parsed[Out]:
        """Read a whole reply; never raises, whatever the text."""


@dataclass(frozen=True)
class Desk:
    """What every question needs beside its input: who answers, from which prompts, how."""

    client: Client
    prompts: PromptSet
    sampling: Sampling = field(default_factory=Sampling)
    max_retry: int = 5
    """Most attempts per question."""
    on_attempt: Callable[[Attempt[object]], None] = lambda _attempt: None
