"""Pairs of a prompt and a reply that designs a machine: the lines of a set to learn from.

A set is a folder with `train.jsonl` and `dev.jsonl`, one pair per line, and a card that says where
they come from (`README.md` for people and hubs, `card.json` for programs).
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ValidationError, field_serializer, field_validator

from agentflow.errors import UsageError
from agentflow.files.atomic import os_errors, write_output
from agentflow.files.faults import tell_fault
from agentflow.llm.messages import Text
from agentflow.machine import Machine

TRAIN, DEV = "train.jsonl", "dev.jsonl"
"""Files of a set. No objective is in both."""
_SPECIAL = re.compile(r"<\|[^|<>\n]{1,40}\|>|</?s>|\[/?INST\]|<<?/?SYS>>?")
"""Texts that chat templates use for themselves: `<|im_end|>`, `</s>`, `[INST]`."""


class ChatMessage(BaseModel, frozen=True, extra="forbid"):
    """One message, in the form that chat templates take."""

    role: Literal["system", "user", "assistant"]
    content: Text


class Pair(BaseModel, frozen=True, extra="forbid"):
    """A prompt and a reply that designs a machine."""

    messages: tuple[ChatMessage, ...]
    """The prompt, as designers get it in a run, then the reply: rationale and program."""
    machine: tuple[Mapping[str, int], ...]
    """The construction tree in the reply, as in machine files. In JSONL it is JSON text: libraries
    that read tables need the same fields in every row, and two-ended blocks have others."""
    objective: str
    """Name of what the machine must do."""
    rationale: str
    """The reply without its program."""
    score: float | None
    """Score of the machine in the objective's scene; None if it was not simulated."""
    source: str
    """Who designed it: name of the model, and whether its machine was edited at random."""

    @field_validator("messages")
    @classmethod
    def _ends_with_a_reply(cls, messages: tuple[ChatMessage, ...]) -> tuple[ChatMessage, ...]:
        roles = [message.role for message in messages]
        if len(roles) < 2 or roles.count("assistant") != 1 or roles[-1] != "assistant":
            raise ValueError("expected a prompt and, at the end, one message of the assistant")
        return messages

    @field_validator("machine", mode="before")
    @classmethod
    def _read_text(cls, machine: object) -> object:
        try:
            return json.loads(machine) if isinstance(machine, str) else machine
        except RecursionError:
            raise ValueError("expected the JSON list of a machine") from None

    @field_serializer("machine")
    def _write_text(self, machine: tuple[Mapping[str, int], ...]) -> str:
        return json.dumps([dict(step) for step in machine])

    @property
    def prompt(self) -> tuple[ChatMessage, ...]:
        """The messages before the reply."""
        return self.messages[:-1]

    @property
    def reply(self) -> str:
        """What a model should learn to answer."""
        return self.messages[-1].content


def make_reply(rationale: str, machine: Machine) -> str:
    """A reply in the format that designers are asked for."""
    return f"{rationale}\n```json\n{machine.to_text()}\n```".lstrip()


def clean_text(text: str) -> str:
    """Text of a model without control characters, and without what ends or begins a message."""
    return _SPECIAL.sub("", "".join(c for c in text if c in "\n\t" or c.isprintable())).strip()


def read_pairs(path: Path) -> Iterator[Pair]:
    """The pairs in a JSONL file, one at a time.

    Raises:
        UsageError: The file cannot be read, or a line is not a pair; the message names the line.
    """
    with os_errors(f"cannot read {path}", UsageError), path.open("rb") as lines:
        for number, line in enumerate(lines, start=1):
            if line.strip():
                yield _read_pair(line, f"{path}, line {number}")


def write_pairs(path: Path, pairs: Iterable[Pair]) -> None:
    """Write pairs to a JSONL file, which replaces an older one only once it is complete.

    Raises:
        UsageError: The file cannot be written.
    """
    with write_output(path) as part, part.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"{pair.model_dump_json()}\n" for pair in pairs)


def make_prompt(prompt: Sequence[Mapping[str, str]]) -> tuple[ChatMessage, ...]:
    """The messages of a prompt such as `agentflow.design_prompt` returns."""
    return tuple(ChatMessage.model_validate(message) for message in prompt)


def make_messages(prompt: Sequence[ChatMessage], reply: str) -> tuple[ChatMessage, ...]:
    """The messages of a pair."""
    return (*prompt, ChatMessage(role="assistant", content=reply))


def make_pair(
    prompt: Sequence[ChatMessage],
    rationale: str,
    machine: Machine,
    reply: str | None,
    *,
    objective: str,
    score: float | None,
    source: str,
) -> Pair:
    """The pair of a reply; None: one that is written from rationale and machine."""
    written = make_reply(rationale, machine) if reply is None else reply
    steps = tuple(step.to_json() for step in machine)
    messages = make_messages(prompt, written)
    return Pair(
        messages=messages,
        machine=steps,
        rationale=rationale,
        objective=objective,
        score=score,
        source=source,
    )


def _read_pair(line: bytes, where: str) -> Pair:
    try:
        return Pair.model_validate_json(line)
    except ValidationError as error:
        raise UsageError(f"{where}: {tell_fault(error, 'the line')}") from None
