"""Owns what a prompt says: the facts behind its fixed headings, as far as they can be read.

Nothing but the messages is looked at. What to answer is decided by the module of each role.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from agentflow.llm.messages import Message
from agentflow.machine.blocks import library
from agentflow.machine.brief import SIZE_LIMIT, Brief
from agentflow.machine.parse import extract_json, read_machine
from agentflow.machine.tree import Machine

_MARKS = {
    "machine_structure": "meta_designer",
    "<Three-Dimensional Perception of the World>": "inspector",
    "<Required Feedback>": "querier",
    "<Modification Steps>": "refiner",
    "First the rationale": "designer",
}
"""What a demanded reply format holds -> who is asked."""
_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)
_ROW = re.compile(r"^\| *(\d{1,6}) *\|", re.MULTILINE)
_REQUIRED = re.compile(r"exactly (\w+) [^()\n]*\(type (\d{1,6})\)")
_METRES = r"(\d{1,6}(?:\.\d{1,6})?)"
_LIMIT = re.compile(rf"{_METRES} m along x, {_METRES} m along y and {_METRES} m along z")
_SCORE = re.compile(r"^Score: (-?\d+(?:\.\d+)?)", re.MULTILINE)
_BROKEN = re.compile(rf"block (\d{{1,6}}) \([^()\n]*\) off block (\d{{1,6}}) at {_METRES} s")
_COMMAND = re.compile(r"(?:add|remove|move) [\d\[][\w \[\]]*", re.IGNORECASE)
_ENTRY = re.compile(r"^(?:> ?)?\d{1,6}\. ", re.MULTILINE)
_CHANGE = re.compile(r"(-?\d+(?:\.\d+)?) -> (-?\d+(?:\.\d+)?)")
_FAILED = re.compile(r"((?:Add|Remove|Move)\b[^:;\n]*): Error", re.IGNORECASE)
_WORDS = {"one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6}


@dataclass(frozen=True)
class Facts:
    """What one prompt says. Empty or None where it says nothing."""

    role: str
    brief: Brief
    blueprint: Mapping[str, Any]
    structure: str
    """Name of the structure to build now."""
    guidance: str
    types: frozenset[int]
    """Types that may be used now: the structure's, or all of the task's."""
    last: bool
    """Whether the machine must be complete after this reply."""
    machine: Machine | None
    critique: str
    report: str
    """The simulation feedback."""
    score: float | None
    broken: tuple[tuple[int, int, float], ...]
    """(block, partner, seconds)."""
    failed: frozenset[str]
    """Edit commands that an earlier attempt or the history shows to fail, in plain letters."""
    whole: bool
    """Whether a refiner is asked for a whole machine."""
    text: str
    """The whole user prompt."""


def read_facts(messages: Sequence[Message]) -> Facts | None:
    """Read the prompt of any role; None where it is none that can be answered."""
    asked = next((message.text for message in messages if message.role == "user"), "")
    system = "\n".join(message.text for message in messages if message.role == "system")
    parts = _sections(asked)
    form = parts.get("Your reply", "")
    role = next((role for mark, role in _MARKS.items() if mark in form), None)
    types = tuple(int(kind) for kind in _ROW.findall(parts.get("Blocks", "")))
    machine = read_machine(parts.get("Current machine", ""), library()).machine
    if role is None or (role in ("inspector", "querier", "refiner") and machine is None):
        return None
    if role == "querier":  # its prompt shows no block table
        types = tuple(library())
    brief = _brief(parts.get("Task", ""), types, f"{system}\n{asked}")
    now = parts.get("Structure to build now", "")
    named = _line(now, "Allowed types")
    allowed = frozenset(map(int, re.findall(r"\d{1,6}", named))) if now else frozenset(types)
    report = parts.get("Simulation feedback", "")
    score = _SCORE.search(report)
    return Facts(
        role=role,
        brief=brief,
        blueprint=extract_json(parts.get("Blueprint", ""), dict).value or {},
        structure=_line(now, "Name"),
        guidance=now.partition("Guidance:")[2] or parts.get("Rationale to follow", ""),
        types=allowed & frozenset(types) & frozenset(library()),
        last=not now or _line(now, "Last structure") == "yes",
        machine=machine,
        critique=parts.get("Critique", ""),
        report=report,
        score=float(score[1]) if score else None,
        broken=tuple((int(a), int(b), float(t)) for a, b, t in _BROKEN.findall(report)),
        failed=_failures(parts, [message.text for message in messages[1:]]),
        whole="holds the whole modified machine" in form,
        text=asked,
    )


def command(text: str) -> str:
    """An edit command in plain letters, for comparison."""
    return " ".join(re.sub(r"[\[\]]", " ", text).lower().split())


def _sections(text: str) -> dict[str, str]:
    pieces = _HEADING.split(text)
    return dict(zip((name.strip() for name in pieces[1::2]), pieces[2::2], strict=True))


def _line(text: str, key: str) -> str:
    found = re.search(rf"^{key}:[ \t]*(.*)$", text, re.MULTILINE)
    return found[1].strip() if found else ""


def _brief(task: str, types: tuple[int, ...], text: str) -> Brief:
    """As much of the brief as validity and designing need."""
    limit = _LIMIT.search(text)
    name = _line(task, "Task")
    return Brief(
        name=name,
        objective=task.partition(f"Task: {name}")[2].strip().partition("\n")[0],
        scene=(),
        schedule=(),
        score=(),
        blocks=tuple(sorted({kind for kind in types if kind in library()})),
        required={
            int(kind): _WORDS.get(count) or int(count)
            for count, kind in _REQUIRED.findall(task)
            if count in _WORDS or (count.isdecimal() and count.isascii())
        },
        size_limit=(float(limit[1]), float(limit[2]), float(limit[3])) if limit else SIZE_LIMIT,
    )


def _failures(parts: Mapping[str, str], later: Sequence[str]) -> frozenset[str]:
    """Commands that ended in an error, and those of edits that lowered the score."""
    told = [parts.get("Earlier attempts", ""), *later]
    failed = [found for text in told for found in _FAILED.findall(text)]
    for entry in _ENTRY.split(parts.get("Edit history", "")):
        change = _CHANGE.search(entry)
        if "Error" in entry or (change and float(change[2]) <= float(change[1])):
            commands = _COMMAND.findall(entry)
            failed += commands if len(commands) == 1 else ["; ".join(map(command, commands))]
    return frozenset(map(command, failed))
