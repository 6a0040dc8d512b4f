"""Read a prompt: its sections by heading, the task, the block types, the current machine.

`Script` is how a role says which prompts are its own, and how the procedural model answers them.
"""

import json
import random
import re
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle
from operator import itemgetter
from typing import Any

from agentflow.llm.messages import Message
from agentflow.machine import Brief, Machine, apply_script, library, read_machine
from agentflow.machine.brief import LONE_ROOT, SIZE_LIMIT, Limits
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates

_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)
_LISTED = re.compile(
    r"^(\d{1,3}(?:/\d{1,3})*) ([A-Z][A-Za-z ]+): (?:on (\d{1,3})\.(\d{1,3}) |faces |"
    r"from (\d{1,3})\.(\d{1,3}(?:/\d{1,3})*) to (\d{1,3})\.(\d{1,3}(?:/\d{1,3})*))",
    re.MULTILINE,
)
_CONTROL = re.compile(r"^(?:\d{1,2}\. (?=Control )|(?=Controllers: ))(.+)$", re.MULTILINE)
_WINDOW = re.compile(r"must end by t = (\d{1,3}(?:\.\d{1,3})?) s")
_ROW = re.compile(r"^\| *([0-9]{1,6}) *\|", re.MULTILINE)
_REQUIRED = re.compile(r"exactly (\w{1,9}) [^()\n]*\(type (\d{1,6})\)")
_MOST_BLOCKS = re.compile(r"at most (\d{1,3}) blocks? \(")
_ROOM = re.compile(r"may be up to (\d{1,2}(?:\.\d)?) m long \(z\) and (\d{1,2}(?:\.\d)?) m high")
_COUNTS = ("no", "one", "two", "three", "four", "five", "six")


@dataclass(frozen=True)
class PromptContent:
    """The content of one prompt; empty where it has none."""

    sections: defaultdict[str, str]  # heading -> text below it, "" for a missing heading
    later: str  # messages after the first reply
    brief: Brief  # as much of the task as validity checks need
    types: frozenset[int]  # allowed block types: the structure's, or all of the task's
    machine: Machine  # the current machine, or only the root
    has_machine: bool  # whether the prompt contains a machine
    coordinates: bool  # whether machines are given as positions and rotations

    def format_machine(self, machine: Machine) -> str:
        """Write a machine in the format of the prompt."""
        return json.dumps(to_coordinates(machine)) if self.coordinates else machine.to_text()


def read_prompt(messages: Sequence[Message]) -> PromptContent:
    """Read the prompt of any role."""
    text = next((message.text for message in messages if message.role == "user"), "")
    pieces = _HEADING.split(text)
    sections = defaultdict(str, zip(map(str.strip, pieces[1::2]), pieces[2::2], strict=True))
    structure, current = sections["Structure to build now"], sections["Current machine"]
    coordinates = '"Position"' in (current or sections["Your reply"])
    machine = read_listing(current)
    if machine is None:
        machine = (read_coordinates if coordinates else read_machine)(current, library()).machine
    types = frozenset(map(int, _ROW.findall(sections["Blocks"]))) & frozenset(library())
    listed = map(int, re.findall(r"[0-9]{1,6}", value_of(structure, "Allowed types")))
    return PromptContent(
        sections=sections,
        later="\n".join(message.text for message in messages[2:]),
        brief=_read_brief(sections["Task"], types, sections["Controls"]),
        types=types.intersection(listed) if structure else types,
        machine=machine or LONE_ROOT,
        has_machine=machine is not None,
        coordinates=coordinates,
    )


def read_listing(text: str) -> Machine | None:
    """Read a machine from its list of blocks, one line each; None if there is no such list."""
    types = {kind.name: kind.type for kind in library().values()}
    steps: list[dict[str, Any]] = []
    for ids, name, parent, face, near, near_faces, far, far_faces in _LISTED.findall(text):
        ends = zip(ids.split("/"), cycle(near_faces.split("/")), cycle(far_faces.split("/")))
        for number, face_a, face_b in ends:
            where = {"parent": parent or -1, "face_id": face or -1}
            if near:
                where = {"parent_a": near, "face_id_a": face_a}
                where |= {"parent_b": far, "face_id_b": face_b}
            steps.append({"type": types.get(name), "id": int(number), **where})
    machine = read_machine(sorted(steps, key=itemgetter("id")), library()).machine
    program = "\n".join(_CONTROL.findall(text))
    return apply_script(machine, program).machine if machine and program else machine


def value_of(text: str, key: str) -> str:
    """The value of a line `key: value`; "" if there is none."""
    found = re.search(rf"^{key}:[ \t]*(.*)$", text, re.MULTILINE)
    return found[1].strip() if found else ""


def _read_brief(task: str, types: frozenset[int], controls: str) -> Brief:
    """Read the task's name, objective, required blocks, most blocks and the window of controls; the
    size is the default unless the task states it."""
    most, window = _MOST_BLOCKS.search(task), _WINDOW.search(controls)
    room = _ROOM.search(task)
    size = (SIZE_LIMIT[0], float(room[2]), float(room[1])) if room else SIZE_LIMIT
    limits = Limits(
        size,
        blocks=int(most[1]) if most else None,
        controls=float(window[1]) if window else None,
        senses="have controllers" in controls,
    )
    found = [(int(kind), count) for count, kind in _REQUIRED.findall(task) if count in _COUNTS]
    required = {kind: _COUNTS.index(count) for kind, count in found if kind in types}
    objective = task.partition("Task:")[2].partition("\n")[2].partition("\n")[0]
    blocks = (0, *sorted(types - {0}))
    return Brief(value_of(task, "Task"), objective, (task,), (), (), blocks, required, limits)


@dataclass(frozen=True)
class Script:
    """A function that answers the prompts of a role."""

    answer: Callable[[PromptContent, random.Random], str]
    """The text of the reply; all random choices are from the generator."""
    asked: str
    """Words in the section "Your reply" by which the role's prompts are known."""
    needs_machine: bool = True
    """Whether prompts without a machine cannot be answered."""

    def fits(self, prompt: PromptContent) -> bool:
        """Whether it can answer a prompt."""
        known = self.asked in prompt.sections["Your reply"]
        return known and (prompt.has_machine or not self.needs_machine)
