"""Owns the refiner: from a machine and what is known of it to a better one.

Applying the edit commands is agentflow.machine's; trying the result is the search's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from agentflow.agents.base import Parsed, Role
from agentflow.agents.context import machine_context, report_context, task_context
from agentflow.agents.history import History
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.replies import Representation, read_reply
from agentflow.agents.sections import sections
from agentflow.agents.verdicts import shortcoming, told
from agentflow.machine.brief import Brief
from agentflow.machine.edits.commands import script_lines
from agentflow.machine.edits.script import StepVerdict, apply_script
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check

THOUGHT = "Thought Process"
DESCRIPTION = "Modification Description"
PREDICTION = "Simulation Prediction After Modification"
STEPS = "Modification Steps"
MAX_LINES = 30
"""Most verdicts told of a failing script."""
MAX_WIDTH = 200
"""Most characters told of a line of a script."""
GEOMETRIC = frozenset({"face_occupied", "overlap", "size_limit"})
"""Codes of failing edits that are about space, not about form or bookkeeping."""


@dataclass(frozen=True)
class RefinerInput:
    """What the refiner works from; what is empty is not shown."""

    brief: Brief
    machine: Machine
    blueprint: Blueprint | None = None
    critique: str = ""
    """An inspector's report."""
    history: History = field(default=History())
    """The edits that led to the machine."""
    score: float | None = None
    feedback: str = ""
    """The default feedback of the machine's simulation."""
    queried: str = ""
    """Answers to a querier's queries."""
    earlier: tuple[str, ...] = ()
    """Verdicts on earlier replies to the same question."""
    spatial: bool = True
    """Whether 3D information is shown."""
    representation: Representation = "tree"
    """How whole machines are written; edit commands are the same in both."""
    format: Literal["steps", "whole_machine"] = "steps"
    """Whether edit commands or a whole machine are asked for."""
    images: tuple[str, ...] = ()
    """Views of the machine as it is built, as PNG data URLs."""


@dataclass(frozen=True)
class Refinement:
    """A new machine, valid and different from the given one, and how it came about."""

    thought: str
    description: str
    prediction: str
    machine: Machine
    script: str = ""
    """The edit commands; "" for a whole machine."""
    steps: tuple[StepVerdict, ...] = ()


class Refiner(Role[RefinerInput, Refinement]):
    """Changes a machine, by edit commands or as a whole."""

    name: ClassVar[str] = "refiner"

    def variables(self, given: RefinerInput) -> Mapping[str, object]:
        """Everything that is known of the machine and was not switched off."""
        return {
            **task_context(given.brief),
            **machine_context(
                given.machine, spatial=given.spatial, representation=given.representation
            ),
            **report_context(given.score, given.feedback),
            "blueprint": given.blueprint and given.blueprint.to_json(),
            "critique": given.critique,
            "history": given.history.to_text(),
            "history_short": given.history.to_short_text(),
            "queried": given.queried,
            "earlier": given.earlier,
            "format": given.format,
            "views": len(given.images),
        }

    def images(self, given: RefinerInput) -> tuple[str, ...]:
        """Its views, if it was given any."""
        return given.images

    def parse(self, text: str, given: RefinerInput) -> Parsed[Refinement]:
        """Read the sections, make the new machine and check it."""
        found = sections(text, (THOUGHT, DESCRIPTION, PREDICTION, STEPS))
        if not found.get(STEPS):
            lack = "is empty" if STEPS in found else "is missing"
            problem = f"The section <{STEPS}> {lack}."
            return Parsed(None, problem, "missing_section", parsed=False)
        read = _whole if given.format == "whole_machine" else _edited
        return read(found, given)


def _edited(found: Mapping[str, str], given: RefinerInput) -> Parsed[Refinement]:
    script = "\n".join(script_lines(found[STEPS]))
    outcome = apply_script(given.machine, script, given.brief)
    if not outcome.success:
        code = next((step.code for step in outcome.steps if step.code), "bad_format")
        problem = "The script fails; the machine is unchanged:\n" + verdict_text(outcome.steps)
        return Parsed(None, problem, code, spatial=False if code in GEOMETRIC else None)
    return _checked(found, given, outcome.machine, script, outcome.steps, repaired=False)


def _whole(found: Mapping[str, str], given: RefinerInput) -> Parsed[Refinement]:
    report = read_reply(found[STEPS], given.brief, given.representation)
    if report.machine is None:
        code = report.problems[0].code if report.problems else "unparsable"
        problem = f"<{STEPS}> holds no valid machine:\n" + told(report.problems)
        parsed, spatial = report.file_valid, report.spatial_valid
        return Parsed(None, problem, code, report.repaired, parsed=parsed, spatial=spatial)
    return _checked(found, given, report.machine, "", (), repaired=report.repaired)


def _checked(
    found: Mapping[str, str],
    given: RefinerInput,
    machine: Machine,
    script: str,
    steps: tuple[StepVerdict, ...],
    *,
    repaired: bool,
) -> Parsed[Refinement]:
    report = check(machine, given.brief)
    refused = shortcoming(machine, report, given.brief, complete=True)
    if refused is None and machine == given.machine:
        refused = "no_change", "The new machine is the same as the current one."
    if refused is not None:
        code, problem = refused
        return Parsed(None, problem, code, repaired, spatial=report.spatial_valid)
    refinement = Refinement(
        thought=found.get(THOUGHT, ""),
        description=found.get(DESCRIPTION, ""),
        prediction=found.get(PREDICTION, ""),
        machine=machine,
        script=script,
        steps=steps,
    )
    return Parsed(refinement, repaired=repaired, spatial=report.spatial_valid)


def verdict_text(steps: Sequence[StepVerdict]) -> str:
    """The verdicts as they are told, one line each and bounded: `Remove 7: Error (code: why)`."""
    lines = [
        f"{step.text[:MAX_WIDTH] or '(no command)'}: {step.verdict}"
        + (f" ({step.code}: {step.reason})" if step.code else "")
        for step in steps
    ]
    if len(lines) <= MAX_LINES:
        return "\n".join(lines)
    return "\n".join([*lines[:MAX_LINES], f"... and {len(lines) - MAX_LINES} more"])
