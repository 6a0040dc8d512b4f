"""The judge: says a sentence about a machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agentflow.llm.procedural.judging import praise

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import RoleInput
from agentflow.llm.procedural.reading import Script
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine


@dataclass(frozen=True)
class JudgeInput(RoleInput):
    """What to judge."""

    machine: Machine


class Judge(Role[JudgeInput, str]):
    """Takes any sentence."""

    name: ClassVar[str] = "judge"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (500, 20)
    labels: ClassVar[tuple[str, ...]] = ("Observe",)
    script: ClassVar[Script] = Script(praise, "One sentence")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> JudgeInput:
        return JudgeInput(brief, machine)

    def variables(self, given: JudgeInput) -> Mapping[str, object]:
        return given.context(given.machine)

    def parse(self, text: str, given: JudgeInput) -> Parsed[str]:  # noqa: ARG002
        return Parsed(text.strip())
