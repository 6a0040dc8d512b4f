"""Owns what a prompt says: its sections by heading, and what most roles need of them.

Nothing but the messages is looked at. What only one role needs is read by that role's module.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from agentflow.llm.messages import Message
from agentflow.machine import Brief, Machine, library, read_machine
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates

_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)
_ROW = re.compile(r"^\| *([0-9]{1,6}) *\|", re.MULTILINE)
_REQUIRED = re.compile(r"exactly (\w{1,9}) [^()\n]*\(type (\d{1,6})\)")
_COUNTS = ("no", "one", "two", "three", "four", "five", "six")


@dataclass(frozen=True)
class Facts:
    """What one prompt says; empty where it says nothing."""

    parts: Mapping[str, str]  # heading -> text below it, "" for a heading that it lacks
    later: str  # what was said after the first answer
    brief: Brief  # as much of it as validity needs
    types: frozenset[int]  # that may be used now: the structure's, or all of the task's
    machine: Machine  # the lone root where none is shown
    shown: bool  # whether one is
    coordinates: bool  # whether machines are written as positions and rotations

    def written(self, machine: Machine) -> str:
        """A machine as the prompt writes its own."""
        return json.dumps(to_coordinates(machine)) if self.coordinates else machine.to_text()


def read_facts(messages: Sequence[Message]) -> Facts:
    """Read the prompt of any role."""
    asked = next((message.text for message in messages if message.role == "user"), "")
    pieces = _HEADING.split(asked)
    parts = defaultdict(str, zip(map(str.strip, pieces[1::2]), pieces[2::2], strict=True))
    now, shown = parts["Structure to build now"], parts["Current machine"]
    coordinates = '"Position"' in (shown or parts["Your reply"])
    machine = (read_coordinates if coordinates else read_machine)(shown, library()).machine
    types = frozenset(map(int, _ROW.findall(parts["Blocks"]))) & frozenset(library())
    listed = map(int, re.findall(r"[0-9]{1,6}", line(now, "Allowed types")))
    return Facts(
        parts=parts,
        later="\n".join(message.text for message in messages[2:]),
        brief=_brief(parts["Task"], types),
        types=types.intersection(listed) if now else types,
        machine=machine or LONE_ROOT,
        shown=machine is not None,
        coordinates=coordinates,
    )


def line(text: str, key: str) -> str:
    """What stands behind a key and a colon at the beginning of a line; "" where nothing does."""
    found = re.search(rf"^{key}:[ \t]*(.*)$", text, re.MULTILINE)
    return found[1].strip() if found else ""


def _brief(task: str, types: frozenset[int]) -> Brief:
    """The building volume is the same for all tasks."""
    found = [(int(kind), count) for count, kind in _REQUIRED.findall(task) if count in _COUNTS]
    required = {kind: _COUNTS.index(count) for kind, count in found if kind in types}
    objective = task.partition("Task:")[2].partition("\n")[2].partition("\n")[0]
    return Brief(line(task, "Task"), objective, (), (), (), (0, *sorted(types - {0})), required)
