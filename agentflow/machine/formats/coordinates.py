"""Read and write machines as coordinates: blocks with absolute positions and rotations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from agentflow.machine.blocks.library import STARTING_BLOCK, library
from agentflow.machine.controllers.reading import read_controls
from agentflow.machine.formats.connect import LocatedBlock, connect
from agentflow.machine.formats.parse import (
    MAX_COORDINATE,
    MISSING,
    Reading,
    driving_problems,
    find_document,
    not_an_object,
    read_whole_number,
)
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.pose import to_metres
from agentflow.machine.problems import Problem, comma_list, short_repr, type_problem
from agentflow.machine.tree import Control, Machine, rename_blocks, with_controls

if TYPE_CHECKING:
    from agentflow.machine.controllers.model import Controllers

FORM = (
    'a JSON list of objects like {"type": 1, "Position": [0, 0, 0.5], "Rotation": [0, 0, 0, 1]}, '
    'two-ended blocks with "end-position"'
)
"""Description of the form, for messages."""
_END = "end-position"
_KEYS = ("type", "Position", "Rotation")


def to_coordinates(machine: Machine) -> Any:
    """A file-valid machine as JSON data in coordinates, with its controls if it has any."""
    return with_controls(coordinates_of(machine), machine)


def coordinates_of(machine: Machine) -> list[dict[str, object]]:
    """The blocks of a file-valid machine in coordinates: metres, machine frame, quaternions
    (x, y, z, w).

    `Position` is the building point, or the first end of a two-ended block; `end-position` is its
    second end, also in the machine frame.
    """
    items: list[dict[str, object]] = []
    for placed in place(machine).blocks:
        item: dict[str, object] = {
            "type": placed.type,
            "Position": list(placed.origin),
            "Rotation": list(placed.quaternion),
        }
        if placed.far is not None:
            item["end-position"] = list(to_metres(placed.far))
        items.append(item)
    return items


def read_coordinates(source: object, blocks: Collection[int] | None = None) -> Reading:
    """Read a machine in coordinates and infer its construction tree. Never raises.

    Args:
        source: any text, or JSON data.
        blocks: allowed block types; the core types if None.
    """
    document = find_document(source, FORM)
    repaired = document.repaired
    if document.fault is not None:
        return Reading(None, repaired, problems=(document.fault,))
    notes = list(document.notes)
    problems: list[Problem] = []
    allowed = library().core if blocks is None else blocks
    read = [
        _read_block(item, index, allowed, notes, problems)
        for index, item in enumerate(document.blocks)
    ]
    located = [block for block in read if block is not None]
    controls = read_controls(document.controls, notes, problems)
    controllers = document.read_controllers(problems)
    if problems:
        return Reading(None, repaired, tuple(notes), tuple(problems))
    reading = connect(located, repaired=repaired, notes=notes)
    return with_controls_of(reading, controls, controllers)


def with_controls_of(
    reading: Reading, controls: Sequence[Control], controllers: Controllers | None = None
) -> Reading:
    """The reading of a machine with controls and controllers, which name blocks by their indices in
    the document.

    Blocks that are not attached to the machine have numbers that no block has.
    """
    if reading.machine is None or not (controls or controllers):
        return reading
    named = {block for each in controls if isinstance(each.target, tuple) for block in each.target}
    named |= controllers.blocks if controllers else set()
    ids = dict.fromkeys(named, -1) | {
        placed.id: index for index, placed in enumerate(reading.blocks)
    }
    machine = replace(
        reading.machine,
        controls=tuple(rename_blocks(controls, ids)),
        controllers=controllers and controllers.renamed(ids),
    )
    return replace(reading, machine=machine, problems=tuple(driving_problems(machine)))


def _read_block(
    item: object, index: int, allowed: Collection[int], notes: list[str], problems: list[Problem]
) -> LocatedBlock | None:
    """Read one item of the list; add a problem and return None if it is not a block."""
    if not isinstance(item, dict):
        problems.append(not_an_object(item, index, _KEYS))
        return None
    kind = item.get("type", MISSING)
    if type(kind) is not int:
        kind = read_whole_number("type", kind, index, notes, problems)
    two_ended = kind is not None and kind in library() and library()[kind].linear
    keys = (*_KEYS, _END) if two_ended else _KEYS
    sizes = {"Position": 3, "Rotation": 4, _END: 3}
    values = [_numbers(item, key, sizes[key], index, notes, problems) for key in keys[1:]]
    if kind is None or None in values:
        return None
    fault = type_problem(kind, allowed, two_ended=two_ended) if index else None
    if index == 0 and kind != STARTING_BLOCK:
        fault = "root", "the first block must be the Starting Block, type 0"
    if fault is not None:
        problems.append(Problem(fault[0], (index,), f"block {index}: {fault[1]}"))
        return None
    extra = [short_repr(key) for key in item if key not in keys]
    if extra:
        notes.append(f"block {index}: ignored {comma_list(extra[:8])}")
    position, rotation, *end = values
    return LocatedBlock(index, kind, position, rotation, *end)  # type: ignore[arg-type]


def _numbers(
    item: dict[object, object],
    key: str,
    count: int,
    index: int,
    notes: list[str],
    problems: list[Problem],
) -> tuple[float, ...] | None:
    """Read the numbers under a key; add a problem and return None if there are none."""
    if key not in item:
        problems.append(Problem("missing_field", (index,), f"block {index} has no {key!r}"))
        return None
    value = item[key]
    numbers = tuple(_number(part) for part in value) if isinstance(value, list) else ()
    if len(numbers) == count and None not in numbers:
        if str in map(type, value):  # type: ignore[call-overload]
            notes.append(f"block {index}: {key} contains strings, read as numbers")
        return numbers  # type: ignore[return-value]
    message = f"block {index}: {key} is {short_repr(value)}, expected a list of {count} numbers"
    problems.append(Problem("not_a_number", (index,), message))
    return None


def _number(value: object) -> float | None:
    """The value as a coordinate; None if it is not a number within limits."""
    if isinstance(value, str) and len(value) < 40:
        with suppress(ValueError):
            value = float(value)
    known = type(value) in (int, float) and abs(value) <= MAX_COORDINATE  # type: ignore[arg-type]
    return float(value) if known else None  # type: ignore[arg-type]
