"""Questions about machines, marked answers, and what every diagnostic provides.

The directory of a diagnosis is continued after a kill, as every call is on record.

diagnosis.json   what is asked of which model; the marked answers and results, once it is finished
calls.jsonl      every call of the model
"""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from pydantic import BaseModel

from agentflow.files.documents import Document
from agentflow.llm.messages import Sampling
from agentflow.machine import Machine
from agentflow.machine.tree import MachineJson


@dataclass(frozen=True)
class Question:
    """One question about one machine.

    `label` names the call, such as "overlap/3". `truth` is the right answer as JSON data, None
    until a simulation has judged it. `about` is what is asked about the machine, if not everything.
    """

    label: str
    machine: Machine
    truth: Any
    about: Any = None


def digest_of(questions: Sequence[Question]) -> str:
    """Content hash, 16 hex digits: models with equal digests were asked the same."""
    asked = [[question.machine.digest, question.truth, question.about] for question in questions]
    # Keys as they are, not sorted: saved diagnoses hold such digests.
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:16]


class Mark(BaseModel, frozen=True, extra="forbid"):
    """A question with its right answer and that of the model, as they are saved.

    `truth` is None if the simulation that judges it crashed or timed out, `answer` if the reply
    holds none that can be read.
    """

    label: str
    machine: MachineJson
    truth: Any
    answer: Any


class Diagnosis(BaseModel, frozen=True, extra="forbid"):
    """The content of diagnosis.json: everything that decides the results, and the results.

    `seed` is that of the questions, and of the simulations. `size` is the total number of
    overlapping pairs, or of questions. `asked` is the content hash of the questions: results of
    models that were asked the same can be compared. `prompts` is the prompt set with the digest of
    its questions. `results` are None until the diagnosis is finished.
    """

    format: Literal[1] = 1
    diagnostic: str
    model: str
    seed: int
    size: int
    asked: str
    sampling: Sampling
    prompts: str
    conditions: Mapping[str, str]
    answers: tuple[Mark, ...] = ()
    results: Mapping[str, Any] | None = None


DOCUMENT = Document("diagnosis.json", Diagnosis, "a diagnosis", outcome=("answers", "results"))


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
