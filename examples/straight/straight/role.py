"""A role: it gives a machine a name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import RoleInput
from agentflow.llm.procedural.reading import PromptContent, Script
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

LONGEST = 3
"""Most words of a name."""


@dataclass(frozen=True)
class NamerInput(RoleInput):
    """The machine that gets a name."""

    machine: Machine


def draw_name(prompt: PromptContent, rng: Random) -> str:
    """How the procedural model plays the role."""
    return f"{rng.choice(('Swift', 'Steady', 'Bold'))} {len(prompt.machine)}"


class Namer(Role[NamerInput, str]):
    """Gives a machine a name of at most three words."""

    name: ClassVar[str] = "namer"
    stage: ClassVar[str] = "initial"
    tokens: ClassVar[tuple[int, int]] = (1500, 10)
    script: ClassVar[Script] = Script(draw_name, "Only a name")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> NamerInput:
        """The input that lists and checks of prompts use."""
        return NamerInput(brief, machine)

    def variables(self, given: NamerInput) -> Mapping[str, object]:
        """What the templates of the prompt may use."""
        return given.context(given.machine)

    def parse(self, text: str, given: NamerInput) -> Parsed[str]:  # noqa: ARG002
        """The name in a reply, or what to ask the model to change."""
        words = text.split()
        if len(words) > LONGEST:
            return Parsed(None, f"The name is too long. Send at most {LONGEST} words.", "too_long")
        return Parsed(" ".join(words))
