"""Small data sets by the procedural model."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

from agentflow.api import design_prompt
from agentflow.llm.messages import Message
from agentflow.llm.procedural import ProceduralClient
from agentflow.llm.procedural.designing import design
from agentflow.llm.procedural.reading import read_prompt
from agentflow.machine import library, read_machine
from agentflow.training.data.pairs import DEV, TRAIN, Pair, make_messages, write_pairs


def make_pairs(task: str, count: int) -> Iterator[Pair]:
    """Pairs for a task; the machines may be equal."""
    prompt = design_prompt(task)
    messages = [Message.model_validate({"role": m["role"], "text": m["content"]}) for m in prompt]
    known = read_prompt(messages)
    for number in range(count):
        reply = design(known, random.Random(number))
        machine = read_machine(reply, library()).machine
        assert machine is not None
        yield Pair(
            messages=make_messages(prompt, reply),
            machine=tuple(machine.to_json()),
            objective=task,
            rationale=reply.partition("\n")[0],
            score=None,
            source=ProceduralClient.name,
        )


def write_set(folder: Path, count: int = 40) -> Path:
    """A set with this many pairs of throwing to train on, and a few of movement to check."""
    folder.mkdir(parents=True)
    write_pairs(folder / TRAIN, make_pairs("throwing", count))
    write_pairs(folder / DEV, make_pairs("movement", 6))
    return folder
