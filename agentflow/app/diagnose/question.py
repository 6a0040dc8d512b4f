"""Questions about machines, marked answers, and what every diagnostic provides."""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import BaseModel

from agentflow.machine import Machine
from agentflow.machine.tree import MachineJson


@dataclass(frozen=True)
class Question:
    """One question about one machine."""

    label: str
    """Name of the call, such as "overlap/3"."""
    machine: Machine
    truth: Any
    """The right answer as JSON data; None until a simulation has judged it."""
    about: Any = None
    """What is asked about the machine, if not everything."""


def digest_of(questions: Sequence[Question]) -> str:
    """Content hash, 16 hex digits: models with equal digests were asked the same."""
    asked = [[question.machine.digest, question.truth, question.about] for question in questions]
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:16]


class Mark(BaseModel, frozen=True, extra="forbid"):
    """A question with its right answer and that of the model, as they are saved."""

    label: str
    machine: MachineJson
    truth: Any
    """None if the simulation that judges it crashed or timed out."""
    answer: Any
    """None if the reply holds no answer that can be read."""


class Diagnostic(ABC):
    """A kind of question. Its templates are in `prompts/<set>/_questions/<name>/`."""

    name: ClassVar[str]

    @abstractmethod
    def questions(self, size: int, seed: int) -> list[Question]:
        """The questions, which depend on these numbers only."""

    @abstractmethod
    def variables(self, question: Question) -> Mapping[str, object]:
        """Variables of the templates."""

    @abstractmethod
    def read(self, text: str, question: Question) -> Any:
        """The answer in a reply as JSON data, None if there is none; never raises."""

    @abstractmethod
    def score(self, marks: Sequence[Mark]) -> dict[str, Any]:
        """The numbers of all answers, as JSON data."""

    async def judge(self, questions: Sequence[Question], workers: int) -> list[Question]:  # noqa: ARG002
        """The questions with their right answers, once all are answered."""
        return list(questions)
