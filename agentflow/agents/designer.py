"""Owns the designer: a whole machine, or one structure of a blueprint added to a given machine.

What makes a machine valid is agentflow.machine's; the order of structures is the workflow's.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import machine_context, task_context
from agentflow.agents.meta_designer import ROOT_TYPE, Blueprint, Structure
from agentflow.agents.replies import Representation, machine_items, read_reply
from agentflow.agents.verdicts import shortcoming, told
from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine

MAX_RATIONALE = 4000
"""Most characters of a rationale that are kept."""
_FENCE = re.compile(r"^[ \t]*```.*?(?:^[ \t]*```[ \t]*$|\Z)", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class DesignerInput:
    """What the designer is asked to build."""

    brief: Brief
    blueprint: Blueprint | None = None
    structure: str | None = None
    """Name of the blueprint's structure to build; None asks for the whole machine."""
    machine: Machine | None = None
    """The machine so far; the design must extend it."""
    last: bool = False
    """Whether the machine is complete with this structure."""
    spatial: bool = True
    """Whether the 3D information of the machine so far is shown."""
    representation: Representation = "tree"
    rationale: str = ""
    """A plan by someone else that the design is to follow."""

    @property
    def part(self) -> Structure | None:
        """The structure to build now."""
        if self.blueprint is None or self.structure is None:
            return None
        return self.blueprint.find(self.structure)


@dataclass(frozen=True)
class Design:
    """A valid machine and why it is as it is."""

    machine: Machine
    rationale: str


class Designer(Role[DesignerInput, Design]):
    """Builds machines from blocks."""

    name: ClassVar[str] = "designer"

    def variables(self, given: DesignerInput) -> Mapping[str, object]:
        """Task, blocks, blueprint, the structure to build and the machine so far."""
        part = given.part
        return {
            **task_context(given.brief),
            **machine_context(
                given.machine, spatial=given.spatial, representation=given.representation
            ),
            "blueprint": _outline(given.blueprint, part),
            "structure": part and _structure_context(part),
            "last": given.last,
            "rationale": given.rationale,
        }

    def parse(self, text: str, given: DesignerInput) -> Parsed[Design]:
        """Read the last machine of the reply and check it against what was given."""
        report = read_reply(text, given.brief, given.representation, given.machine)
        machine, repaired = report.machine, report.repaired
        if machine is None:
            code = report.problems[0].code if report.problems else "unparsable"
            problem = "The reply holds no valid machine:\n" + told(report.problems)
            parsed, spatial = report.file_valid, report.spatial_valid
            return Parsed(None, problem, code, repaired, parsed=parsed, spatial=spatial)
        refused = (
            _altered(machine, given)
            or _foreign(machine, given)
            or shortcoming(machine, report, given.brief, complete=given.last or given.part is None)
        )
        if refused:
            code, problem = refused
            return Parsed(None, problem, code, repaired, spatial=report.spatial_valid)
        design = Design(machine, rationale_of(text))
        return Parsed(design, repaired=repaired, spatial=report.spatial_valid)


def rationale_of(text: str) -> str:
    """The prose of a reply: what stands outside its fences, bounded."""
    return _FENCE.sub("", text).strip()[:MAX_RATIONALE]


def _outline(blueprint: Blueprint | None, part: Structure | None) -> dict[str, Any] | None:
    """The blueprint without the guidance of the structure that is built now: that is told apart."""
    if blueprint is None:
        return None
    data = blueprint.to_json()
    if part is not None:
        data["machine_structure"][part.name] = {"type": list(part.types)}
    return data


def _structure_context(part: Structure) -> dict[str, object]:
    return {
        "name": part.name,
        "types": sorted({ROOT_TYPE, *part.types}),
        "guidance": part.guidance,
    }


def _altered(machine: Machine, given: DesignerInput) -> tuple[str, str] | None:
    if given.machine is None:
        return None
    was, now = (machine_items(item, given.representation) for item in (given.machine, machine))
    for step, old in zip(given.machine, was, strict=True):
        new = machine[step.id] if step.id < len(machine) else None
        if new != step:
            fate = "left out" if new is None else f"changed to {json.dumps(now[step.id])}"
            return (
                "given_altered",
                f"Block {step.id} of the current machine, {json.dumps(old)}, was {fate}. "
                f"Repeat its {len(given.machine)} steps unchanged and append new ones.",
            )
    if len(machine) == len(given.machine):
        return "nothing_added", "The machine has no new block. Append at least one."
    return None


def _foreign(machine: Machine, given: DesignerInput) -> tuple[str, str] | None:
    part = given.part
    if part is None:
        return None
    start = len(given.machine) if given.machine else 1
    for step in machine.steps[start:]:
        if step.type not in part.types:
            allowed = ", ".join(map(str, part.types)) or "none"
            return (
                "type_outside_structure",
                f"Block {step.id} is of type {step.type}, which structure {part.name!r} "
                f"does not allow; allowed: {allowed}.",
            )
    return None
