"""Read Besiege's machine files (.bsg), including those that players made."""

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import NoReturn
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

from agentflow.machine.blocks.library import STARTING_BLOCK, library
from agentflow.machine.formats.connect import LocatedBlock, connect, facing_of
from agentflow.machine.formats.parse import MAX_BLOCKS, MAX_COORDINATE, Reading
from agentflow.machine.geometry.vectors import Quat, Vec3, add, rotate_vector
from agentflow.machine.problems import Problem, RefusedEdit, short_repr, type_problem

START, END, END_TURN = "start-position", "end-position", "end-rotation"
SCALE_TOLERANCE = 0.001
MAX_DEPTH = 64
"""Maximum nesting of the XML; machine files need six levels."""

_EXPECTED = f"expected a number of at most {MAX_COORDINATE:,.0f}"
_ORIGIN = (0.0, 0.0, 0.0)


def read_bsg(text: str, blocks: Collection[int] | None = None) -> Reading:
    """Read a .bsg file and infer its construction tree. Never raises.

    Blocks are identified by their index in the file; the Starting Block always comes first.
    Unreadable blocks and those of other types become `problems`. Blocks that are scaled, rotated
    off the six orientations, or not attached to anything become `loose`.

    Args:
        text: content of the file.
        blocks: allowed block types; the core types if None.
    """
    try:
        root = _parse_xml(text)
    except ValueError as error:
        return Reading(problems=(Problem("not_xml", (), str(error)),))
    found = root.findall("./Blocks/Block") if root.tag == "Machine" else []
    if not found:
        message = "this is not a Besiege machine file: it has no Machine element with Blocks"
        return Reading(problems=(Problem("not_a_machine", (), message),))
    if len(found) > MAX_BLOCKS:
        message = f"the machine has {len(found)} blocks; the maximum is {MAX_BLOCKS}"
        return Reading(problems=(Problem("too_many_blocks", (), message),))
    reader = _Reader(library().core if blocks is None else blocks)
    for index, block in enumerate(found):
        reader.read(block, index)
    return reader.result()


class _SafeBuilder(TreeBuilder):
    """Builds the elements of untrusted XML: no document type or entities, no deep nesting."""

    depth = 0

    def start(self, tag: str, attributes: dict[str, str]) -> Element:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ValueError(f"the XML is nested more than {MAX_DEPTH} levels deep")
        return super().start(tag, attributes)

    def end(self, tag: str) -> Element:
        self.depth -= 1
        return super().end(tag)

    def doctype(self, *_: object) -> NoReturn:
        raise ValueError("the XML declares a document type, which is not allowed")


def _parse_xml(text: str) -> Element:
    parser = XMLParser(target=_SafeBuilder())
    try:
        parser.feed(text)
        root: Element = parser.close()
    except ParseError as error:
        raise ValueError(f"this is not well-formed XML: {error}") from None
    except UnicodeEncodeError:
        raise ValueError("this is not well-formed XML: it contains lone surrogates") from None
    return root


@dataclass
class _Reader:
    """The blocks and problems read from a file so far."""

    allowed: Collection[int]
    root: LocatedBlock | None = None
    others: list[LocatedBlock] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    loose: list[Problem] = field(default_factory=list)
    bad_root: bool = False
    """Whether a Starting Block was reported as a problem."""

    def read(self, block: Element, index: int) -> None:
        """Read one block, or add a problem."""
        try:
            located = self._read_block(block, index)
        except RefusedEdit as fault:
            message = f"block {index} of the file ({_ids(block)}): {fault.reason}"
            is_root = (block.get("id") or "").strip() == str(STARTING_BLOCK)
            problems = self.loose if fault.code == "scale" and not is_root else self.problems
            problems.append(Problem(fault.code, (index,), message))
            self.bad_root |= is_root
            return
        if located.type == STARTING_BLOCK:
            self.root = located
            return
        self.others.append(located)
        flipped = block.findtext("./Data/Boolean[@key='flipped']", "False").strip() == "True"
        wheel = library()[located.type].powered_wheel
        if wheel and flipped != (facing_of(located.rotation) == "x-"):
            self.notes.append(
                f"block {index} of the file ({_ids(block)}): its 'flipped' setting was ignored; "
                "here a wheel's facing determines its direction"
            )

    def result(self) -> Reading:
        """Connect the blocks and collect all problems."""
        if self.root is None:
            missing = Problem("root", (), "the file has no Starting Block, id 0")
            problems = (*self.problems, *(() if self.bad_root else (missing,)))
            return Reading(problems=problems, loose=tuple(self.loose))
        located = connect([self.root, *self.others], notes=self.notes)
        loose = sorted((*self.loose, *located.loose), key=lambda problem: problem.blocks)
        return replace(located, problems=tuple(self.problems), loose=tuple(loose))

    def _read_block(self, block: Element, index: int) -> LocatedBlock:
        kind = self._type(block)
        x, y, z, w = _numbers(block.find("./Transform/Rotation"), "xyzw", "Rotation")
        rotation = (x, y, z, w)
        position = _point(block.find("./Transform/Position"), "xyz", "Position")
        scale = block.find("./Transform/Scale")
        factors = () if scale is None else _point(scale, "xyz", "Scale")
        if any(abs(factor - 1) > SCALE_TOLERANCE for factor in factors):
            size = " x ".join(f"{factor:g}" for factor in factors)
            raise RefusedEdit("scale", f"it is scaled to {size}; blocks cannot be scaled here")
        if not library()[kind].linear:
            return LocatedBlock(index, kind, position, rotation)
        end = block.find(f"./Data/Vector3[@key='{END}']")
        start = block.find(f"./Data/Vector3[@key='{START}']")
        a = _ORIGIN if start is None else _point(start, "XYZ", START)
        b = _point(end, "XYZ", END)
        start_point, end_point = (add(position, _rotate(rotation, reach)) for reach in (a, b))
        return LocatedBlock(index, kind, start_point, rotation, end_point)

    def _type(self, block: Element) -> int:
        text = (block.get("id") or "").strip()
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            reason = f"its id is {short_repr(text)}, expected a block type"
            raise RefusedEdit("not_a_number", reason)
        kind = int(text)
        if kind == STARTING_BLOCK and self.root is None:
            return kind
        two_ended = kind in library() and library()[kind].linear
        if fault := type_problem(kind, self.allowed, two_ended=two_ended):
            raise RefusedEdit(*fault)
        return kind


def _ids(block: Element) -> str:
    guid = block.get("guid")
    return f"id {short_repr(block.get('id'))}" + (f", guid {short_repr(guid)}" if guid else "")


def _point(element: Element | None, names: str, what: str) -> Vec3:
    x, y, z = _numbers(element, names, what)
    return (x, y, z)


def _numbers(element: Element | None, names: str, what: str) -> list[float]:
    """Numbers in attributes, or in child elements, with these names."""
    if element is None:
        raise RefusedEdit("missing_field", f"it has no {what}")
    numbers = []
    for name in names:
        text = element.get(name) or element.findtext(name) or ""
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not abs(number) <= MAX_COORDINATE:
            reason = f"{name} of its {what} is {short_repr(text)}, {_EXPECTED}"
            raise RefusedEdit("not_a_number", reason)
        numbers.append(number)
    return numbers


def _rotate(rotation: Quat, vector: Vec3) -> Vec3:
    """Rotate a vector by a quaternion of any length but 0."""
    length = math.sqrt(sum(part * part for part in rotation)) or 1.0
    x, y, z, w = (part / length for part in rotation)
    return rotate_vector((x, y, z, w), vector)
