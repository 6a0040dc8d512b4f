"""Owns reading Besiege's machine files (.bsg), players' own included (spec 1.9).

The XML is opened by xmltext.py; which block hangs on which is inferred by connect.py.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from xml.etree.ElementTree import Element

from agentflow.machine.blocks.library import STARTING_BLOCK, library
from agentflow.machine.blocks.types import Vec3
from agentflow.machine.formats.connect import (
    LocatedBlock,
    LocatedMachine,
    add_floats,
    connect,
    facing_of,
)
from agentflow.machine.formats.parse import MAX_BLOCKS, MAX_COORDINATE
from agentflow.machine.formats.xml_text import UnsafeXmlError, parse_xml
from agentflow.machine.geometry.pose import Quat
from agentflow.machine.problems import Problem, short_repr, type_problem

START, END, END_TURN = "start-position", "end-position", "end-rotation"
SCALE_TOLERANCE = 0.001

_EXPECTED = f"expected a number of at most {MAX_COORDINATE:,.0f}"
_ORIGIN = (0.0, 0.0, 0.0)


def read_bsg(text: str, blocks: Collection[int] | None = None) -> LocatedMachine:
    """Read a .bsg file and find out what hangs on what. Never raises.

    Blocks are named by their place in the file, counted from 0; the Starting Block comes first
    wherever it stands. What cannot be read is left out with its problem: blocks of other types
    in `problems`, scaled and turned ones, and those that hang on nothing, in `loose`.

    Args:
        text: what the file holds.
        blocks: allowed block types; the core types when None.
    """
    try:
        root = parse_xml(text)
    except UnsafeXmlError as error:
        return LocatedMachine(problems=(Problem("not_xml", (), str(error)),))
    found = root.findall("./Blocks/Block") if root.tag == "Machine" else []
    if not found:
        message = "this is no machine file of Besiege: there is no Machine with Blocks in it"
        return LocatedMachine(problems=(Problem("not_a_machine", (), message),))
    if len(found) > MAX_BLOCKS:
        message = f"the machine has {len(found)} blocks; at most {MAX_BLOCKS} are read"
        return LocatedMachine(problems=(Problem("too_many_blocks", (), message),))
    reader = _Reader(library().core if blocks is None else blocks)
    for index, block in enumerate(found):
        reader.read(block, index)
    return reader.located()


class _BadBlock(Exception):
    """A block that cannot be taken over."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


@dataclass
class _Reader:
    """What has been read of a file."""

    allowed: Collection[int]
    root: LocatedBlock | None = None
    spots: list[LocatedBlock] = field(default_factory=list)
    """All blocks but the root."""
    notes: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    loose: list[Problem] = field(default_factory=list)
    unread_root: bool = False
    """Whether a Starting Block could not be taken in, which its problem says."""

    def read(self, block: Element, index: int) -> None:
        """Take one block in, or note why not."""
        try:
            spot = self._spot(block, index)
        except _BadBlock as fault:
            message = f"block {index} of the file ({_ids(block)}): {fault.reason}"
            root = (block.get("id") or "").strip() == str(STARTING_BLOCK)
            kept = self.loose if fault.code == "scale" and not root else self.problems
            kept.append(Problem(fault.code, (index,), message))
            self.unread_root |= root
            return
        if spot.type == STARTING_BLOCK:
            self.root = spot
            return
        self.spots.append(spot)
        flipped = block.findtext("./Data/Boolean[@key='flipped']", "False").strip() == "True"
        wheel = library()[spot.type].powered_wheel
        if wheel and flipped != (facing_of(spot.rotation) == "x-"):
            self.notes.append(
                f"block {index} of the file ({_ids(block)}): a wheel's direction follows from its "
                "facing here, its 'flipped' setting is not kept"
            )

    def located(self) -> LocatedMachine:
        """The blocks that could be connected, and what became of the others."""
        if self.root is None:
            missing = Problem("root", (), "the file has no Starting Block, id 0")
            problems = (*self.problems, *(() if self.unread_root else (missing,)))
            return LocatedMachine(problems=problems, loose=tuple(self.loose))
        located = connect([self.root, *self.spots], notes=self.notes)
        loose = sorted((*self.loose, *located.loose), key=lambda problem: problem.blocks)
        return replace(located, problems=tuple(self.problems), loose=tuple(loose))

    def _spot(self, block: Element, index: int) -> LocatedBlock:
        kind = self._type(block)
        rotation = _quaternion(block)
        position = _point(block.find("./Transform/Position"), "xyz", "Position")
        scale = block.find("./Transform/Scale")
        if scale is not None:
            factors = _point(scale, "xyz", "Scale")
            if any(abs(factor - 1) > SCALE_TOLERANCE for factor in factors):
                told = " x ".join(f"{factor:g}" for factor in factors)
                raise _BadBlock("scale", f"it is scaled to {told}; blocks have their own size here")
        if not library()[kind].linear:
            return LocatedBlock(index, kind, position, rotation)
        end = block.find(f"./Data/Vector3[@key='{END}']")
        start = block.find(f"./Data/Vector3[@key='{START}']")
        a = _ORIGIN if start is None else _point(start, "XYZ", START)
        b = _point(end, "XYZ", END)
        ends = (add_floats(position, _turned(rotation, reach)) for reach in (a, b))
        return LocatedBlock(index, kind, next(ends), rotation, next(ends))

    def _type(self, block: Element) -> int:
        text = (block.get("id") or "").strip()
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise _BadBlock("not_a_number", f"its id is {short_repr(text)}, expected a block type")
        kind = int(text)
        if kind == STARTING_BLOCK and self.root is None:
            return kind
        two_ended = kind in library() and library()[kind].linear
        fault = type_problem(kind, self.allowed, two_ended=two_ended)
        if fault is not None:
            raise _BadBlock(*fault)
        return kind


def _ids(block: Element) -> str:
    guid = block.get("guid")
    return f"id {short_repr(block.get('id'))}" + (f", guid {short_repr(guid)}" if guid else "")


def _quaternion(block: Element) -> Quat:
    numbers = _numbers(block.find("./Transform/Rotation"), "xyzw", "Rotation")
    x, y, z, w = numbers
    return (x, y, z, w)


def _point(element: Element | None, names: str, what: str) -> Vec3:
    x, y, z = _numbers(element, names, what)
    return (x, y, z)


def _numbers(element: Element | None, names: str, what: str) -> list[float]:
    """Numbers in attributes, or in children of these names."""
    if element is None:
        raise _BadBlock("missing_field", f"it has no {what}")
    numbers = []
    for name in names:
        text = element.get(name) or element.findtext(name) or ""
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not abs(number) <= MAX_COORDINATE:
            raise _BadBlock(
                "not_a_number", f"{name} of its {what} is {short_repr(text)}, {_EXPECTED}"
            )
        numbers.append(number)
    return numbers


def _turned(rotation: Quat, vector: Vec3) -> Vec3:
    """A vector of a block's own frame in the machine frame."""
    length = math.sqrt(sum(part * part for part in rotation)) or 1.0
    x, y, z, w = (part / length for part in rotation)
    a, b, c = vector
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (
        a + w * u + y * t - z * v,
        b + w * v + z * u - x * t,
        c + w * t + x * v - y * u,
    )
