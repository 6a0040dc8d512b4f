"""Read construction trees from text or JSON data, and check their file validity."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import plate_of
from agentflow.machine.controllers.reading import read_controls
from agentflow.machine.controls import control_problems
from agentflow.machine.formats.json_text import iter_json
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.problems import Problem, comma_list, face_problem, short_repr, type_problem
from agentflow.machine.tree import ROOT, Machine, Step, with_controls

if TYPE_CHECKING:
    from agentflow.machine.controllers.model import Controllers

MAX_BLOCKS = 800
"""Maximum number of blocks; machines that fit the building volume have far fewer."""
MAX_COORDINATE = 1e6
"""Maximum absolute coordinate, in metres."""

_STANDARD = ("type", "id", "parent", "face_id")
_TWO_ENDED = ("type", "id", "parent_a", "face_id_a", "parent_b", "face_id_b")
FORM = 'a JSON list of objects like {"type": 1, "id": 1, "parent": 0, "face_id": 4}'
MISSING = object()


@dataclass(frozen=True)
class Reading:
    """The result of reading a machine in any form."""

    machine: Machine | None = None
    """Without unattached blocks; None if nothing could be read."""
    repaired: bool = False
    notes: tuple[str, ...] = ()
    """Irregularities that were tolerated: extra keys, numbers as strings, ambiguous parents."""
    problems: tuple[Problem, ...] = ()
    """Everything that makes it file-invalid."""
    blocks: tuple[Placed, ...] = ()
    """Attached blocks, if read from positions; ids are document indices and may have gaps."""
    loose: tuple[Problem, ...] = ()
    """Blocks without a parent or with an illegal rotation, which make it spatially invalid."""


def read_machine(
    source: object, blocks: Collection[int] | None = None, given: Machine | None = None
) -> Reading:
    """Read a construction tree and check its file validity. Never raises.

    Args:
        source: any text, or JSON data.
        blocks: allowed block types; the core types if None.
        given: blocks that the machine must begin with; any root if None.
    """
    document = find_document(source, FORM)
    repaired = document.repaired
    if document.fault is not None:
        return Reading(None, repaired, problems=(document.fault,))
    notes = list(document.notes)
    problems: list[Problem] = []
    steps = [_read_step(item, index, notes, problems) for index, item in enumerate(document.blocks)]
    problems += file_problems(steps, blocks, given)
    problems.sort(key=lambda problem: problem.blocks)
    controls = read_controls(document.controls, notes, problems)
    controllers = document.read_controllers(problems)
    if not problems:
        machine = Machine(tuple(step for step in steps if step is not None), controls, controllers)
        problems = driving_problems(machine)
        if not problems:
            return Reading(machine, repaired, tuple(notes))
    return Reading(None, repaired, tuple(notes), tuple(problems))


class Document(NamedTuple):
    """The JSON data of a machine in any form."""

    blocks: list[object]
    controls: object = None
    controllers: object = None
    notes: tuple[str, ...] = ()
    repaired: bool = False
    fault: Problem | None = None
    """Why it holds no machine."""

    def but(self, blocks: list[Any], given: Machine | None = None) -> object:
        """JSON data with other blocks, and the same controls and controllers; those that it does
        not state are those of a given machine."""
        controlled = given is not None and given.controlled
        data = with_controls(blocks, given) if given and controlled else {"blocks": blocks}
        own = {"controls": self.controls, "controllers": self.controllers}
        data |= {key: value for key, value in own.items() if value is not None}
        return data if len(data) > 1 else blocks

    def read_controllers(self, problems: list[Problem]) -> Controllers | None:
        """The controllers, if there are any that can be read; adds what is wrong with them."""
        if self.controllers is None:
            return None
        from agentflow.machine.controllers.reading import read_controllers  # needs pydantic

        return read_controllers(self.controllers, problems)


def driving_problems(machine: Machine) -> list[Problem]:
    """What is wrong with the controls and controllers of a machine on any task."""
    found = control_problems(machine)
    if machine.controllers is not None:
        from agentflow.machine.controllers.reading import controller_problems  # needs pydantic

        found += controller_problems(machine.controllers, machine.steps)
    return found


def find_document(source: object, form: str) -> Document:
    """Find the machine of a reply or of JSON data: a list of blocks, or an object that has one.

    Args:
        source: any text, or JSON data.
        form: description of the expected form, for messages.
    """
    repaired, controls, controllers = False, None, None
    notes: tuple[str, ...] = ()
    if isinstance(source, str):
        source, repaired = _find_machine(source)
        if source is None:
            message = f"no JSON list found; write the whole machine as {form}"
            return Document([], repaired=repaired, fault=Problem("not_json", (), message))
    if isinstance(source, dict) and "blocks" in source:
        known = ("blocks", "controls", "controllers")
        extra = [short_repr(key) for key in source if key not in known]
        notes = (f"the machine: ignored {comma_list(extra[:8])}",) if extra else ()
        controls, controllers = source.get("controls"), source.get("controllers")
        source = source["blocks"]
    if isinstance(source, list) and 0 < len(source) <= MAX_BLOCKS:
        return Document(source, controls, controllers, notes, repaired)
    code, message = "not_a_list", f"the machine is {short_repr(source)}; write it as {form}"
    if source == []:
        code, message = "empty", f"the machine is an empty list; write it as {form}"
    elif isinstance(source, list):
        code = "too_many_blocks"
        message = f"the machine has {len(source)} blocks; the maximum is {MAX_BLOCKS}"
    return Document([], repaired=repaired, fault=Problem(code, (), message))


def _find_machine(text: str) -> tuple[object, bool]:
    """The best list that looks like a machine, else the best object with such a list as `blocks`,
    else the best list; None if there is none."""
    fallback: tuple[object, bool] = (None, False)
    for value, repaired in iter_json(text, list):
        if _is_machine(value):
            return value, repaired
        if fallback[0] is None:
            fallback = (value, repaired)
    if "blocks" in text:
        for value, repaired in iter_json(text, dict):
            if _is_machine(value.get("blocks")):
                return value, repaired
    return fallback


def _is_machine(value: object) -> bool:
    """Whether JSON data look like the blocks of a machine."""
    return (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(item, dict) and "type" in item for item in value)
    )


def _read_step(item: object, index: int, notes: list[str], problems: list[Problem]) -> Step | None:
    """Read one item of the list; add a problem and return None if it is not a step."""
    if not isinstance(item, dict):
        problems.append(not_an_object(item, index, _STANDARD))
        return None
    two_ended = "parent_b" in item or "parent_a" in item
    keys = _TWO_ENDED if two_ended else _STANDARD
    values: list[int] = []
    for key in keys:
        value = item.get(key, MISSING)
        if type(value) is not int:
            value = read_whole_number(key, value, index, notes, problems)
        if isinstance(value, int):
            values.append(value)
    if len(values) < len(keys):
        return None
    if len(item) > len(keys):
        extra = [short_repr(key) for key in item if key not in keys]
        notes.append(f"block {index}: ignored {comma_list(extra[:8])}")
    kind, block_id, parent, face_id, *second = values
    return Step(block_id, kind, parent, face_id, *second)


def not_an_object(item: object, index: int, keys: Sequence[str]) -> Problem:
    """The problem of an item of a machine's list that is no object with these keys."""
    expected = f"expected an object with {comma_list(keys)}"
    message = f"item {index} of the machine's list is {short_repr(item)}; {expected}"
    return Problem("not_an_object", (index,), message)


def read_whole_number(
    key: str, value: object, index: int, notes: list[str], problems: list[Problem]
) -> int | None:
    """Convert a value to a whole number; add a problem and return None if that is impossible.

    `MISSING` stands for a missing value.
    """
    if value is MISSING:
        problems.append(Problem("missing_field", (index,), f"block {index} has no {key!r}"))
        return None
    if isinstance(value, str) and len(value) < 12:
        digits = value.strip().removeprefix("-")
        if digits.isascii() and digits.isdigit():
            notes.append(f"block {index}: {key} is the string {value!r}, read as a number")
            return int(value)
    message = f"block {index}: {key} is {short_repr(value)}, expected a whole number"
    problems.append(Problem("not_a_number", (index,), message))
    return None


def file_problems(
    steps: Sequence[Step | None],
    blocks: Collection[int] | None = None,
    given: Machine | None = None,
) -> list[Problem]:
    """Everything that makes steps file-invalid.

    Args:
        steps: in list order; None for unreadable items.
        blocks: allowed block types; the core types if None.
        given: blocks that the machine must begin with; any root if None.
    """
    if not steps:
        return [Problem("empty", (), f"the machine is an empty list; write it as {FORM}")]
    allowed = library().core if blocks is None else blocks
    begin = (ROOT,) if given is None else given.steps
    if given is None and steps[0] is not None and plate_of(steps[0].type):
        begin = (replace(ROOT, type=steps[0].type),)
    problems = _start_problems(steps, begin)
    for index, step in enumerate(steps):
        if step is None or index < len(begin):
            continue
        if step.id != index:
            message = (
                f"item {index} of the list has id {short_repr(step.id)}; ids are 0, 1, 2, ... "
                f"in list order, so it must be {index}"
            )
            problems.append(Problem("id_sequence", (index,), message))
        fault = type_problem(step.type, allowed, two_ended=step.parent_b is not None)
        if fault is not None:
            problems.append(Problem(fault[0], (index,), f"block {index}: {fault[1]}"))
        problems += _attachment_problems(index, step.parent, step.face_id, steps)
        if step.parent_b is not None and step.face_id_b is not None:
            problems += _attachment_problems(index, step.parent_b, step.face_id_b, steps)
    return problems


def _start_problems(steps: Sequence[Step | None], begin: tuple[Step, ...]) -> list[Problem]:
    """Problems of the blocks that every machine must begin with."""
    if begin == (ROOT,):
        if steps[0] is None or steps[0] == ROOT:
            return []
        message = "the first block must be the Starting Block: type 0, id 0, parent -1, face_id -1"
        return [Problem("root", (0,), message)]
    problems = []
    for index, wanted in enumerate(begin):
        if index >= len(steps) or steps[index] not in (None, wanted):
            text = json.dumps(wanted.to_json())
            message = f"block {index} is given and must be repeated unchanged: {text}"
            problems.append(Problem("given_altered", (index,), message))
    return problems


def _attachment_problems(
    index: int, parent: int, face_id: int, steps: Sequence[Step | None]
) -> list[Problem]:
    """Problems of one attachment of a block other than the root."""
    if not 0 <= parent < len(steps):
        message = f"block {index}: parent {short_repr(parent)} does not exist; "
        message += f"the blocks are 0 to {len(steps) - 1}"
        return [Problem("parent_not_found", (index,), message)]
    if parent >= index:
        message = f"block {index}: parent {parent} does not come before block {index}"
        return [Problem("parent_not_earlier", (index,), message)]
    carrier = steps[parent]
    fault = face_problem(parent, carrier.type, face_id) if carrier is not None else None
    return [Problem("face_not_found", (index,), f"block {index}: {fault}")] if fault else []
