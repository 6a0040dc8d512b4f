"""The placer: adds blocks to the structure that a task gives, in one call."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import block_rows, task_context
from agentflow.agents.designer import DesignedMachine, Designer, DesignerInput
from agentflow.agents.replies import machine_text
from agentflow.llm.procedural.placing import place_cogs
from agentflow.llm.procedural.reading import Script
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine


@dataclass(frozen=True)
class PlacerInput:
    """A task; its brief holds the given structure."""

    brief: Brief


class Placer(Role[PlacerInput, DesignedMachine]):
    """Adds blocks to a given structure."""

    name: ClassVar[str] = "placer"
    stage: ClassVar[str] = "initial"
    tokens: ClassVar[tuple[int, int]] = (3230, 220)
    model_role: ClassVar[str] = "designer"
    labels: ClassVar[tuple[str, ...]] = ("Build",)
    script: ClassVar[Script] = Script(place_cogs, "Place cogs")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> PlacerInput:  # noqa: ARG003
        return PlacerInput(brief)

    def variables(self, given: PlacerInput) -> Mapping[str, object]:
        brief, start = given.brief, given.brief.given
        kinds = {*brief.blocks, *(step.type for step in start.steps[1:])}
        return {
            **task_context(brief),
            "blocks": block_rows([library()[kind] for kind in sorted(kinds)]),
            "machine": machine_text(start, "tree"),
            "first_id": len(start),
            "first_step": json.dumps(start[0].to_json()),
        }

    def parse(self, text: str, given: PlacerInput) -> Parsed[DesignedMachine]:
        """Read the last machine of the reply, as the designer does."""
        parsed = Designer().parse(text, DesignerInput(given.brief))
        return parsed if parsed.parsed else replace(parsed, spatial=None)
