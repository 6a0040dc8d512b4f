"""Answers of a model to design objectives, as `agentflow data generate` records them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel

from agentflow.agents.designer import FENCE, MAX_RATIONALE, extract_rationale
from agentflow.llm.messages import Message, Text
from agentflow.training.data.folder import read_log, read_plan
from agentflow.training.data.pairs import ChatMessage
from agentflow.training.objectives import Objective

ANSWERS = "answers.jsonl"
COMMAND = "agentflow data generate"


class ObjectivePrompt(BaseModel, frozen=True, extra="forbid"):
    """An objective, and the prompt that asks for a machine that meets it."""

    objective: Objective
    prompt: tuple[ChatMessage, ...]

    @property
    def messages(self) -> tuple[Message, ...]:
        """The prompt for a client."""
        return tuple(Message(role=item.role, text=item.content) for item in self.prompt)


class AnswerPlan(BaseModel, frozen=True, extra="forbid"):
    """Everything that decides the answers in a folder, apart from the model's own chance."""

    kind: Literal["answers"] = "answers"
    format: Literal[1] = 1
    model: str
    """Name of the model in results."""
    sampling: Mapping[str, Any]
    seed: int
    samples: int
    """Answers to each objective."""
    limit: int | None
    """Maximum number of answers; they are spread over the objectives."""
    variants: float
    """Machines made by random edits for each answer with a valid machine, on average."""
    questions: tuple[ObjectivePrompt, ...]

    @property
    def count(self) -> int:
        """Number of answers."""
        whole = self.samples * len(self.questions)
        return whole if self.limit is None else min(whole, self.limit)

    def asked(self) -> Iterator[tuple[ObjectivePrompt, int]]:
        """Question and number of the sample of each answer, in their order in the file."""
        pairs = ((question, n) for n in range(self.samples) for question in self.questions)
        return islice(pairs, self.count)


class Answer(BaseModel, frozen=True, extra="forbid"):
    """One answer: rationale and program apart, and machines made from it by random edits."""

    objective: str
    sample: int
    source: str
    """Name of the model."""
    finish: str
    """Why the reply ended; see `llm.messages.Finish`."""
    rationale: Text
    program: Text
    """As the model wrote it."""
    variants: tuple[tuple[Mapping[str, int], ...], ...] = ()
    """Construction trees."""


def split_reply(text: str) -> tuple[str, str]:
    """The rationale of a reply, and its program: the code fences, or else all from the first list.

    Never raises. The rationale is cut to `MAX_RATIONALE` characters.
    """
    if fences := FENCE.findall(text):
        return extract_rationale(text), "\n".join(fences)
    start = text.find("[")
    if start < 0:
        return text.strip()[:MAX_RATIONALE], ""
    return text[:start].strip()[:MAX_RATIONALE], text[start:]


def read_answers(folder: Path) -> tuple[AnswerPlan, Iterator[Answer]]:
    """The plan of a folder of answers, and its answers, one at a time.

    Raises:
        RunError: It is not such a folder, or (while iterating) a line is damaged.
    """
    plan = read_plan(folder, AnswerPlan, COMMAND)
    return plan, read_log(folder / ANSWERS, Answer)
