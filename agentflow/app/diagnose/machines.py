"""The machines of questions: random ones, and designs of the built-in model, with random edits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from random import Random

from agentflow.agents.base import chat_prompt
from agentflow.agents.context import types_context
from agentflow.agents.designer import Designer
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.llm.messages import Message
from agentflow.llm.procedural.designing import build_machine
from agentflow.llm.procedural.reading import PromptContent, read_prompt
from agentflow.machine import Machine, library

SIZES = (5, 20)
"""Fewest and most blocks of a machine; as in the published question."""


def diagnosed_levels() -> tuple[str, ...]:
    """Levels whose designs are used: the first one of each family that is `diagnosed`."""
    return tuple(name for name, family in FAMILIES.items() if family.diagnosed)


def draw_design(rng: Random, level: str) -> Machine:
    """A design of the built-in model for a level, of a size in `SIZES`."""
    while True:
        machine, _ = build_machine(_prompt(level), rng)
        if SIZES[0] <= len(machine) <= SIZES[1]:
            return machine


@cache
def _prompt(level: str) -> PromptContent:
    """The prompt of a designer, as the built-in model reads it."""
    _, user = chat_prompt(Designer, get_task(level).brief)
    return read_prompt([Message(role="user", text=user["content"])])


def describe_blocks(machine: Machine) -> Mapping[str, object]:
    """Template variables of a machine and of the types that it uses, without its geometry."""
    kinds = [library()[kind] for kind in sorted({step.type for step in machine})]
    return {"representation": "tree", "machine": machine.to_text(), **types_context(kinds)}


def list_ids(blocks: Sequence[int]) -> str:
    """Block ids in a sentence: "3, 5 and 8"."""
    *first, last = map(str, blocks)
    return f"{', '.join(first)} and {last}" if first else last
