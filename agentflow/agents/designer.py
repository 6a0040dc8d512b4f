"""The designer: builds a whole machine, or adds one structure of a blueprint; the placer adds
blocks to a given structure."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import ROOT_TYPE, RoleInput, block_rows, task_context
from agentflow.agents.meta_designer import Blueprint, Structure
from agentflow.agents.replies import machine_items, machine_text, no_machine, read_reply, rejection
from agentflow.llm.procedural.designing import design
from agentflow.llm.procedural.placing import place_cogs
from agentflow.llm.procedural.reading import Script
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.description.geometry_info import describe_text
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine

MAX_RATIONALE = 4000
FENCE = re.compile(r"^[ \t]*```.*?(?:^[ \t]*```[ \t]*$|\Z)", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Draft:
    """A reply that does not count, and what its check tells the designer."""

    reply: str
    findings: str


@dataclass(frozen=True)
class DesignerInput(RoleInput):
    """What to build."""

    blueprint: Blueprint | None = None
    structure: str | None = None
    """Name of the blueprint's structure to build; None for the whole machine."""
    machine: Machine | None = None
    """The machine so far; the design must extend it."""
    last: bool = False
    """Whether this structure completes the machine."""
    rationale: str = ""
    """A plan from another run that the design should follow."""
    draft: Draft | None = None
    """What was sent to be checked before this."""

    @property
    def part(self) -> Structure | None:
        """The structure to build now."""
        if self.blueprint is None or self.structure is None:
            return None
        return self.blueprint.find(self.structure)


@dataclass(frozen=True)
class DesignedMachine:
    """A valid machine and the rationale for it."""

    machine: Machine
    rationale: str


class Designer(Role[DesignerInput, DesignedMachine]):
    """Builds machines from blocks."""

    name: ClassVar[str] = "designer"
    stage: ClassVar[str] = "initial"
    sees: ClassVar[bool] = True
    tokens: ClassVar[tuple[int, int]] = (3230, 220)
    labels: ClassVar[tuple[str, ...]] = ("Build",)
    script: ClassVar[Script] = Script(design, "First the rationale", needs_machine=False)

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> DesignerInput:  # noqa: ARG003
        return DesignerInput(brief)

    def variables(self, given: DesignerInput) -> Mapping[str, object]:
        part = given.part
        return {
            **given.context(given.machine),
            "blueprint": _outline(given.blueprint, part),
            "structure": part
            and {
                "name": part.name,
                "types": sorted({ROOT_TYPE, *part.types}),
                "guidance": part.guidance,
            },
            "last": given.last,
            "next_id": len(given.machine or ()),
            "rationale": given.rationale,
            "draft": given.draft and vars(given.draft),
            "drafting": False,
        }

    def parse(self, text: str, given: DesignerInput) -> Parsed[DesignedMachine]:
        """Read the last machine of the reply and check it against the input."""
        report = read_reply(text, given.brief, given.representation, given.machine)
        machine, repaired = report.machine, report.repaired
        if machine is None:
            return no_machine(report)
        refused = (
            _find_altered_block(machine, given)
            or _find_foreign_block(machine, given)
            or rejection(machine, report, given.brief, complete=given.last or given.part is None)
        )
        if refused:
            code, problem = refused
            return Parsed(None, problem, code, repaired, spatial=report.spatial_valid)
        design = DesignedMachine(machine, extract_rationale(text))
        return Parsed(design, repaired=repaired, spatial=report.spatial_valid)


class Drafter(Role[DesignerInput, Draft]):
    """The designer as it sends a draft: every reply with a machine is checked and accepted."""

    name: ClassVar[str] = "drafter"
    stage: ClassVar[str] = "initial"
    sees: ClassVar[bool] = True
    tokens: ClassVar[tuple[int, int]] = Designer.tokens
    model_role: ClassVar[str] = Designer.name
    labels: ClassVar[tuple[str, ...]] = Designer.labels
    script: ClassVar[Script | None] = Designer.script

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> DesignerInput:
        return Designer.sample(brief, machine)

    def variables(self, given: DesignerInput) -> Mapping[str, object]:
        return {**Designer().variables(given), "drafting": True}

    def parse(self, text: str, given: DesignerInput) -> Parsed[Draft]:
        """The draft with its findings. The problem and its code are what a design would have been
        refused for; a reply without anything to check is refused."""
        judged = Designer().parse(text, given)
        if judged.code == "not_json":
            return Parsed(None, judged.problem, judged.code, parsed=False)
        report = read_reply(text, given.brief, given.representation, given.machine)
        findings = [judged.problem or "The draft is valid."]
        findings += [f"Warning: {warning.message}." for warning in report.warnings]
        if report.machine is not None:
            findings += _joined_pairs(report.machine)
            if given.spatial:
                shown = report.machine
                findings += [describe_text(shown, given.brief), statics_text(shown, given.brief)]
        draft = Draft(text, "\n".join(findings))
        found = (judged.problem, judged.code, judged.repaired, judged.parsed, judged.spatial)
        return Parsed(draft, *found)


def _joined_pairs(machine: Machine) -> list[str]:
    """A warning for each pair of blocks that meeting faces join."""
    geometry = place(machine)
    return [
        f"Warning: face {pair.face_id} of {geometry[pair.block].label} meets face "
        f"{pair.partner_face} of {geometry[pair.partner].label}: the two are joined."
        for pair in geometry.auto_connections
    ]


def extract_rationale(text: str) -> str:
    """The prose of a reply: its text outside code fences, cut to `MAX_RATIONALE`."""
    return FENCE.sub("", text).strip()[:MAX_RATIONALE]


def _outline(blueprint: Blueprint | None, part: Structure | None) -> dict[str, Any] | None:
    """The blueprint, without the guidance for the current structure, which is shown separately."""
    if blueprint is None:
        return None
    data = blueprint.to_json()
    if part is not None:
        data["machine_structure"][part.name] = {"type": list(part.types)}
    return data


def _find_altered_block(machine: Machine, given: DesignerInput) -> tuple[str, str] | None:
    if given.machine is None:
        return None
    was, now = (machine_items(item, given.representation) for item in (given.machine, machine))
    for step, old in zip(given.machine, was, strict=True):
        new = machine[step.id] if step.id < len(machine) else None
        if new != step:
            change = "left out" if new is None else f"changed to {json.dumps(now[step.id])}"
            return (
                "given_altered",
                f"Block {step.id} of the current machine, {json.dumps(old)}, was {change}. "
                f"Send only the new steps, with ids from {len(given.machine)} on.",
            )
    if len(machine) == len(given.machine):
        return "nothing_added", "The machine has no new block. Append at least one."
    return None


def _find_foreign_block(machine: Machine, given: DesignerInput) -> tuple[str, str] | None:
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


class Placer(Role[RoleInput, DesignedMachine]):
    """Adds blocks to the structure that a task gives."""

    name: ClassVar[str] = "placer"
    stage: ClassVar[str] = "initial"
    tokens: ClassVar[tuple[int, int]] = (3230, 220)
    model_role: ClassVar[str] = "designer"
    labels: ClassVar[tuple[str, ...]] = ("Build",)
    script: ClassVar[Script] = Script(place_cogs, "Place cogs")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> RoleInput:  # noqa: ARG003
        return RoleInput(brief)

    def variables(self, given: RoleInput) -> Mapping[str, object]:
        brief, start = given.brief, given.brief.given
        kinds = {*brief.blocks, *(step.type for step in start.steps[1:])}
        return {
            **task_context(brief),
            "blocks": block_rows([library()[kind] for kind in sorted(kinds)]),
            "machine": machine_text(start, "tree"),
            "first_id": len(start),
            "first_step": json.dumps(start[0].to_json()),
        }

    def parse(self, text: str, given: RoleInput) -> Parsed[DesignedMachine]:
        """Read the last machine of the reply, as the designer does."""
        parsed = Designer().parse(text, DesignerInput(given.brief))
        return parsed if parsed.parsed else replace(parsed, spatial=None)
