"""Reading replies: named sections, whole machines, and the problems that go back to the model."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

from agentflow.agents.base import Parsed
from agentflow.machine.brief import Brief
from agentflow.machine.formats.coordinates import coordinates_of, read_coordinates, to_coordinates
from agentflow.machine.formats.parse import find_document, read_machine
from agentflow.machine.problems import REQUIRED_COUNT, Problem
from agentflow.machine.tree import Machine, lines_of
from agentflow.machine.validity import Report, check

Representation = Literal["tree", "coordinates"]
"""How machines are written: construction tree, or absolute positions and rotations."""
MAX_PROBLEMS = 8
"""Maximum number of problems listed; the first usually cause the others."""
_TAG = re.compile(r"<(/?)([^<>\n]{1,80})>")
_SENTENCE = re.compile(r"(?<=[.!?])\s+|\n+")
_EXPECTED = re.compile(
    r"\b(?:will|should|would|expect(?:s|ed|ing)?|predict(?:s|ed|ing)?)\b|'ll\b", re.IGNORECASE
)


def machine_items(machine: Machine, representation: Representation) -> Sequence[object]:
    """The blocks of a machine as JSON data."""
    if representation == "tree":
        return [step.to_json() for step in machine]
    return coordinates_of(machine)


def machine_text(machine: Machine, representation: Representation) -> str:
    """A machine as JSON text, one block or control per line."""
    return machine.to_text() if representation == "tree" else lines_of(to_coordinates(machine))


def read_reply(
    text: str, brief: Brief, representation: Representation, given: Machine | None = None
) -> Report:
    """Read and check the last machine of a reply or of a section of it; never raises.

    The reply may begin with the `given` machine, or go on from it: a list that does not begin with
    a root is appended to it. Coordinates do not say which block a block is attached to, so blocks
    in the positions of given ones keep the given attachments.
    """
    source, repaired = _whole(text, given, representation)
    if representation == "tree":
        report = check(read_machine(source, brief.blocks, brief.given), brief)
    else:
        report = check(read_coordinates(source, brief.blocks), brief)
    report = replace(report, repaired=report.repaired or repaired)
    return report if representation == "tree" else _keep_attachments(report, brief, given)


def _whole(text: str, given: Machine | None, representation: Representation) -> tuple[object, bool]:
    """A reply, or all items of a machine if it has only those after the given ones.

    And whether its JSON was repaired in the second case.
    """
    if given is None:
        return text, False
    document = find_document(text, "")
    first = document.blocks[0] if document.blocks else None
    whole = not isinstance(first, dict) or str(first.get("type")) == str(given[0].type)
    if document.fault or whole:
        return text, False
    blocks = [*machine_items(given, representation), *document.blocks]
    return document.but(blocks, given), document.repaired


def _keep_attachments(report: Report, brief: Brief, given: Machine | None) -> Report:
    """The report on a machine in coordinates, with given blocks attached as they were."""
    if report.machine is None or given is None:
        return report
    if coordinates_of(report.machine)[: len(given)] != coordinates_of(given):
        return report
    whole = replace(report.machine, steps=(*given.steps, *report.machine.steps[len(given) :]))
    judged = check(whole, brief)
    if judged.machine is None:
        return report
    return replace(judged, repaired=report.repaired, notes=report.notes)


def no_machine(report: Report, where: str = "The reply") -> Parsed[Any]:
    """The result of parsing a reply that holds no valid machine."""
    code = report.problems[0].code if report.problems else "unparsable"
    problem = f"{where} contains no valid machine:\n" + problem_list(report.problems)
    parsed, spatial = report.file_valid, report.spatial_valid
    return Parsed(None, problem, code, report.repaired, parsed=parsed, spatial=spatial)


def problem_list(problems: Sequence[Problem]) -> str:
    """The first problems, one per line, then how many more there are."""
    lines = [f"- {problem.message}" for problem in problems[:MAX_PROBLEMS]]
    if len(problems) > MAX_PROBLEMS:
        lines.append(f"- and {len(problems) - MAX_PROBLEMS} more")
    return "\n".join(lines)


def rejection(
    machine: Machine, report: Report, brief: Brief, *, complete: bool
) -> tuple[str, str] | None:
    """Why a file-valid machine cannot be accepted, as (code, problem); None if it can.

    A complete machine must be task-valid. An incomplete one must still not have more blocks of a
    type than the task requires, because later steps cannot remove them.
    """
    if problems := report.problems if complete else report.lasting_problems:
        return problems[0].code, "The machine is not valid:\n" + problem_list(problems)
    for kind, most in sorted(brief.required.items()):
        if machine.count(kind) > most:
            return (
                REQUIRED_COUNT,
                f"The machine has {machine.count(kind)} blocks of type {kind}; "
                f"the task requires exactly {most}.",
            )
    return None


def find_sections(text: str, names: Iterable[str]) -> dict[str, str]:
    """Find the named XML-like sections of a reply: name -> stripped content, if found.

    Tags may have any letter case, and spaces, underscores or hyphens between words. An unclosed
    section ends at the next known tag or at the end of the text. If a name is repeated, the last
    closed section counts, or else the last unclosed one. Never raises; linear in the text's length.
    """
    known = {_key(name): name for name in names}
    closed: dict[str, str] = {}
    unclosed: dict[str, str] = {}
    next_open: dict[str, int] = {}
    next_close: dict[str, int] = {}
    next_tag = len(text)
    for tag in reversed(list(_TAG.finditer(text))):
        name = known.get(_key(tag[2]))
        if name is None:
            continue
        if tag[1] == "/":
            next_close[name] = tag.start()
        else:
            close = next_close.get(name)
            if close is not None and close < next_open.get(name, len(text)):
                closed.setdefault(name, text[tag.end() : close].strip())
            else:
                unclosed.setdefault(name, text[tag.end() : next_tag].strip())
            next_open[name] = tag.start()
        next_tag = tag.start()
    return {**unclosed, **closed}


def _key(name: str) -> str:
    return " ".join(re.split(r"[\s_-]+", name.strip().strip("/"))).strip().casefold()


def expectations(text: str) -> str:
    """The sentences of a text that say what is expected, because agents have no field for it."""
    return " ".join(part for part in _SENTENCE.split(text) if _EXPECTED.search(part))
