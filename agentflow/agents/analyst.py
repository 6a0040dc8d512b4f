"""The analyst: writes lessons anew from what the edits of a run did to scores."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import MOST_TOKENS, RoleInput, task_context, within
from agentflow.agents.replies import find_sections
from agentflow.llm.procedural.reading import Script
from agentflow.llm.procedural.refining import analyse
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

LESSONS = "Lessons"
SAMPLE = "-1 Brace: -8.00, to 8.00"
"""A lesson for sample inputs."""


@dataclass(frozen=True)
class AnalystInput(RoleInput):
    """What a run has tried."""

    lessons: tuple[str, ...] = ()
    """What edits did to the score, one line each, the most telling first."""
    mechanisms: tuple[str, ...] = ()
    """The classes of mechanisms found, with their best scores, one line each."""
    earlier: tuple[str, ...] = ()
    """The lessons that an analyst of this run wrote before."""


class Analyst(Role[AnalystInput, tuple[str, ...]]):
    """Writes the lessons that designers and refiners read, one line each."""

    name: ClassVar[str] = "analyst"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (1200, 150)
    labels: ClassVar[tuple[str, ...]] = ("Reflect",)
    script: ClassVar[Script] = Script(analyse, f"<{LESSONS}>")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> AnalystInput:  # noqa: ARG003
        return AnalystInput(brief, lessons=(SAMPLE,))

    def variables(self, given: AnalystInput) -> Mapping[str, object]:
        tried = {name: list(getattr(given, name)) for name in ("lessons", "mechanisms", "earlier")}
        return {**task_context(given.brief), **tried, "most_tokens": MOST_TOKENS}

    def parse(self, text: str, given: AnalystInput) -> Parsed[tuple[str, ...]]:  # noqa: ARG002
        """Read the first lines of the section, as many as prompts have room for."""
        found = find_sections(text, (LESSONS,))
        if LESSONS not in found:
            problem = f"The reply has no section <{LESSONS}>."
            return Parsed(None, problem, "missing_section", parsed=False)
        lines = (line.strip(" \t-*") for line in found[LESSONS].splitlines())
        kept = within([line for line in lines if line], MOST_TOKENS)
        if not kept:
            problem = f"<{LESSONS}> has no line of at most {MOST_TOKENS} tokens."
            return Parsed(None, problem, "no_lesson")
        return Parsed(tuple(kept))
