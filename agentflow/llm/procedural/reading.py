"""Owns what a prompt says: the facts behind its fixed headings, as far as they can be read.

Nothing but the messages is looked at. What to answer is decided by the module of each role.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from agentflow.llm.messages import Message
from agentflow.machine.blocks import library
from agentflow.machine.brief import Brief
from agentflow.machine.coordinates import read_coordinates, to_coordinates
from agentflow.machine.parse import read_machine
from agentflow.machine.tree import Machine

_ASKED = {"machine_structure": "meta_designer", "First the rationale": "designer",
          "<Three-Dimensional Perception of the World>": "inspector",
          "<Required Feedback>": "querier", "<Modification Steps>": "refiner",
          "Place cogs": "placer"}  # fmt: skip
"""Words of a demanded reply format -> role that is asked."""
_NUMBER = r"(-?\d{1,6}(?:\.\d{1,6})?)"
_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)
_ROW = re.compile(r"^\| *([0-9]{1,6}) *\|", re.MULTILINE)
_REQUIRED = re.compile(r"exactly (\w{1,9}) [^()\n]*\(type (\d{1,6})\)")
_BROKEN = re.compile(rf"block (\d{{1,6}}) \([^()\n]*\) off block (\d{{1,6}}) at {_NUMBER} s")
_COMMAND = re.compile(r"(?:add|remove|move) ?[\d\[][\d\[\] toin]*", re.IGNORECASE)
_ENTRY = re.compile(r"^(?:> ?)?\d{1,6}\. ", re.MULTILINE)
_CHANGE = re.compile(rf"{_NUMBER} -> {_NUMBER}")
_COUNTS = ("no", "one", "two", "three", "four", "five", "six")


@dataclass(frozen=True)
class Facts:
    """What one prompt says; empty where it says nothing."""

    role: str
    brief: Brief
    task: str  # as it is told
    structure: str  # name of the structure to build now
    guidance: str
    types: frozenset[int]  # that may be used now: the structure's, or all of the task's
    machine: Machine | None
    told: str  # simulation feedback and critique
    broken: tuple[tuple[int, int, float], ...]  # block, partner, seconds
    failed: frozenset[str]  # commands and scripts that led to an error or to no better score
    whole: bool  # whether a refiner is to send a whole machine
    coordinates: bool  # whether machines are written as positions and rotations

    def written(self, machine: Machine) -> str:
        """A machine as the prompt writes its own."""
        return json.dumps(to_coordinates(machine)) if self.coordinates else machine.to_text()


def read_facts(messages: Sequence[Message]) -> Facts | None:
    """Read the prompt of any role; None where it is none that can be answered."""
    asked = next((message.text for message in messages if message.role == "user"), "")
    pieces = _HEADING.split(asked)
    parts = dict(zip(map(str.strip, pieces[1::2]), pieces[2::2], strict=True))
    form, now = parts.get("Your reply", ""), parts.get("Structure to build now", "")
    role = next((role for words, role in _ASKED.items() if words in form), "")
    shown = parts.get("Current machine", "")
    coordinates = '"Position"' in (shown or form)
    machine = (read_coordinates if coordinates else read_machine)(shown, library()).machine
    if not role or (machine is None and role in ("inspector", "querier", "refiner", "placer")):
        return None
    types = frozenset(map(int, _ROW.findall(parts.get("Blocks", "")))) & frozenset(library())
    listed = frozenset(map(int, re.findall(r"[0-9]{1,6}", _line(now, "Allowed types"))))
    report = parts.get("Simulation feedback", "")
    return Facts(
        role=role,
        brief=_brief(parts.get("Task", ""), types),
        task=parts.get("Task", ""),
        structure=_line(now, "Name"),
        guidance=now.partition("Guidance:")[2] + parts.get("Rationale to follow", ""),
        types=types & listed if now else types,
        machine=machine,
        told=report + parts.get("Critique", ""),
        broken=tuple((int(a), int(b), float(t)) for a, b, t in _BROKEN.findall(report)),
        failed=_failures(parts, messages),
        whole="whole modified machine" in form,
        coordinates=coordinates,
    )


def plain(commands: Iterable[str]) -> str:
    """Edit commands in plain letters, for comparison."""
    return "; ".join(" ".join(re.sub(r"[\[\]]", " ", line).lower().split()) for line in commands)


def _line(text: str, key: str) -> str:
    found = re.search(rf"^{key}:[ \t]*(.*)$", text, re.MULTILINE)
    return found[1].strip() if found else ""


def _brief(task: str, types: frozenset[int]) -> Brief:
    """As much of the brief as validity needs; the building volume is the same for all tasks."""
    found = [(int(kind), count) for count, kind in _REQUIRED.findall(task) if count in _COUNTS]
    required = {kind: _COUNTS.index(count) for kind, count in found if kind in types}
    objective = task.partition("Task:")[2].partition("\n")[2].partition("\n")[0]
    return Brief(_line(task, "Task"), objective, (), (), (), (0, *sorted(types - {0})), required)


def _failures(parts: Mapping[str, str], messages: Sequence[Message]) -> frozenset[str]:
    """Lines marked Error, and the scripts of edits that failed or did not raise the score."""
    told = "\n".join([parts.get("Earlier attempts", ""), *(m.text for m in messages[2:])])
    failed = [plain(_COMMAND.findall(line)[:1]) for line in told.splitlines() if ": Error" in line]
    for entry in _ENTRY.split(parts.get("Edit history", "")):
        change = _CHANGE.search(entry)
        if "Error" in entry or (change and float(change[2]) <= float(change[1])):
            failed.append(plain(_COMMAND.findall(entry)))
    return frozenset(failed)
