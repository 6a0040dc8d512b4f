"""The refiner: improves a machine from everything known about it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from agentflow.agents.base import Parsed, Replies, Role
from agentflow.agents.context import SAMPLE_REPORT, RoleInput, report_context
from agentflow.agents.history import History
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.replies import find_sections, no_machine, read_reply, rejection
from agentflow.llm.procedural.reading import Script
from agentflow.llm.procedural.refining import refine
from agentflow.machine.brief import Brief
from agentflow.machine.description.statics_text import statics_text
from agentflow.machine.edits.commands import is_machine, script_lines
from agentflow.machine.edits.difference import Renumbering, matching_ids, renumbering
from agentflow.machine.edits.script import StepVerdict, apply_script
from agentflow.machine.tree import Machine
from agentflow.machine.validity import Report, check

NO_CHANGE = "no change"
"""Description of a refinement that leaves the machine as it is."""
_NOTHING = frozenset({"none", NO_CHANGE})
THOUGHT = "Thought Process"
DESCRIPTION = "Modification Description"
PREDICTION = "Simulation Prediction After Modification"
STEPS = "Modification Steps"
_KEEP = f"to keep the machine, leave <{STEPS}> empty"
_ONLY_CONTROLS = (
    "The blocks have changed, but only the controls may change between trials: use only the "
    "commands Control, Uncontrol and Set."
)
TRIED_STAGES = ("initial", "blind_refinement")
"""Stages whose machines get all trials of the task."""
MAX_LINES = 30
"""Maximum number of verdicts shown for a failing script."""
GEOMETRIC = frozenset(
    {"face_occupied", "overlap", "size_limit", "duplicate_connection", "too_many_parts"}
)
"""Codes of failing edits that are about geometry, not about format or ids."""


@dataclass(frozen=True)
class RefinerInput(RoleInput):
    """A machine and what is known about it; empty fields are left out of the prompt."""

    machine: Machine
    blueprint: Blueprint | None = None
    critique: str = ""
    history: History = field(default=History())
    score: float | None = None
    feedback: str = ""
    trials: str = ""
    """What single edits of the machine did to its score."""
    queried: str = ""
    earlier: tuple[str, ...] = ()
    """Verdicts on earlier replies to the same question."""
    format: Literal["steps", "whole_machine"] = "steps"
    """Whether to ask for edit commands or for a whole machine."""
    trial: int = 0
    """Number of the trial to revise the controls for, from 2; 0 if blocks may change as well."""
    images: tuple[str, ...] = ()
    """Pictures of the machine as built, as PNG data URLs."""


@dataclass(frozen=True)
class Refinement:
    """A valid machine: the given one if the section of commands is empty, else another one."""

    machine: Machine
    description: str
    """The edit in the refiner's words."""
    script: str = ""
    """The edit commands, with what they have changed; "" for a whole machine or no change."""
    ids: Renumbering = field(default_factory=dict)
    """Ids of the given machine and names in the script -> ids of the new machine."""


class Refiner(Role[RefinerInput, Refinement]):
    """Edits a machine by commands, rewrites it as a whole, or leaves it as it is."""

    name: ClassVar[str] = "refiner"
    stage: ClassVar[str] = "env_feedback"
    tokens: ClassVar[tuple[int, int]] = (4590, 80)
    replies: ClassVar[Replies] = "edits"
    labels: ClassVar[tuple[str, ...]] = ("Revise", "Restructure")
    script: ClassVar[Script] = Script(refine, f"<{STEPS}>")

    @classmethod
    def sample(cls, brief: Brief, machine: Machine) -> RefinerInput:
        return RefinerInput(brief, machine, score=0.0, feedback=SAMPLE_REPORT)

    @classmethod
    def stage_for(cls, purpose: str) -> str:
        """Blind refinement if the purpose is "blind"; for trials the purpose is the stage of the
        machine; else the feedback loop."""
        stages = {"blind": "blind_refinement", **{name: name for name in TRIED_STAGES}}
        return stages.get(purpose, cls.stage)

    @classmethod
    def prediction(cls, text: str) -> str:
        """It has a section of its own."""
        return find_sections(text, (PREDICTION,)).get(PREDICTION, "")

    def variables(self, given: RefinerInput) -> Mapping[str, object]:
        told = "\n\n".join(filter(None, (given.feedback, given.trials)))
        report = report_context(given.score, told)
        blind = given.spatial and not report["report"]
        return {
            **given.context(given.machine),
            **report,
            "blueprint": given.blueprint and given.blueprint.to_json(),
            "statics": statics_text(given.machine, given.brief) if blind else "",
            "critique": given.critique,
            "history": given.history.to_text(),
            "history_short": given.history.to_short_text(),
            "queried": given.queried,
            "earlier": given.earlier,
            "format": given.format,
            "trial": given.trial,
            "views": len(given.images),
        }

    def images(self, given: RefinerInput) -> tuple[str, ...]:
        return given.images

    def parse(self, text: str, given: RefinerInput) -> Parsed[Refinement]:
        """Read the sections, build the new machine and check it."""
        found = find_sections(text, (THOUGHT, DESCRIPTION, PREDICTION, STEPS))
        if STEPS not in found:
            problem = f"The section <{STEPS}> is missing."
            return Parsed(None, problem, "missing_section", parsed=False)
        lines = script_lines(found[STEPS])
        if not lines or lines[0].strip(" .*()").casefold() in _NOTHING:
            return Parsed(Refinement(given.machine, NO_CHANGE), spatial=True)
        if given.format == "whole_machine" or is_machine(lines):
            return _read_machine(found, given)
        return _read_script(found, given, "\n".join(lines))


def _read_script(found: Mapping[str, str], given: RefinerInput, script: str) -> Parsed[Refinement]:
    outcome = apply_script(given.machine, script, given.brief)
    if not outcome.success:
        code = next((step.code for step in outcome.steps if step.code), "bad_format")
        problem = "The script failed; the machine is unchanged:\n" + verdict_text(outcome.steps)
        return Parsed(None, problem, code, spatial=False if code in GEOMETRIC else None)
    ids = renumbering(given.machine, outcome.id_map, outcome.names)
    report = check(outcome.machine, given.brief)
    return _judge(found, given, outcome.machine, report, outcome.annotated, ids)


def _read_machine(found: Mapping[str, str], given: RefinerInput) -> Parsed[Refinement]:
    report = read_reply(found[STEPS], given.brief, given.representation)
    if report.machine is None:
        return no_machine(report, f"<{STEPS}>")
    ids = renumbering(given.machine, matching_ids(given.machine, report.machine), {})
    return _judge(found, given, report.machine, report, "", ids)


def _judge(
    found: Mapping[str, str],
    given: RefinerInput,
    machine: Machine,
    report: Report,
    script: str,
    ids: Renumbering,
) -> Parsed[Refinement]:
    repaired = report.repaired
    refused = rejection(machine, report, given.brief, complete=True)
    if refused is None and machine == given.machine:
        refused = "no_change", f"The new machine is the same as the current one; {_KEEP}."
    if refused is None and given.trial and machine.steps != given.machine.steps:
        refused = "blocks_altered", _ONLY_CONTROLS
    if refused is not None:
        code, problem = refused
        return Parsed(None, problem, code, repaired, spatial=report.spatial_valid)
    refinement = Refinement(report.machine or machine, found.get(DESCRIPTION, ""), script, ids)
    return Parsed(refinement, repaired=repaired, spatial=report.spatial_valid)


def verdict_text(steps: Sequence[StepVerdict]) -> str:
    """One line per verdict; later ones are only counted."""
    more = [f"... and {len(steps) - MAX_LINES} more"] if len(steps) > MAX_LINES else []
    return "\n".join([*map(str, steps[:MAX_LINES]), *more])
