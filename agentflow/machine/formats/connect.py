"""Owns connecting: from blocks at points in space to the construction tree that puts them there.

Reading the points is coordinates.py's and bsg.py's, judging the tree validity.py's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

from agentflow.machine.blocks.types import Vec3
from agentflow.machine.geometry.placement import place_step
from agentflow.machine.geometry.pose import FACINGS, UNITS, Placed, Quat, Units3, add, to_metres
from agentflow.machine.problems import Problem, block_label
from agentflow.machine.tree import ROOT, Machine, Step, renumber

__all__ = ["TOLERANCE", "LocatedBlock", "LocatedMachine", "connect", "facing_of"]

TOLERANCE = 0.1
"""Furthest that a block may be from the face it hangs on, in metres (spec 1.3)."""
MAX_TURN = 1.0
"""Furthest that a rotation may be from one of the six, in degrees."""
MAX_HINTS = 10
"""Most problems that name the nearest face; looking for it takes time."""

_CELL = 10
"""Width of the cells that faces are looked up in, in units. Faces lie on a grid as wide, in the
middle of the cells."""
_HALF = _CELL // 2
_CLOSEST = math.cos(math.radians(MAX_TURN) / 2) - 1e-12
_REACH = TOLERANCE * UNITS + 1e-6


@dataclass(frozen=True, slots=True)
class LocatedBlock:
    """A block as its document places it. Metres, the document's frame."""

    index: int
    """Its place in the document, counted from 0."""
    type: int
    position: Vec3
    """Building point; the first end of a two-ended block."""
    rotation: Quat
    """(x, y, z, w), of any length but 0; not looked at for two-ended blocks."""
    end: Vec3 | None = None
    """Second end of a two-ended block."""


@dataclass(frozen=True)
class LocatedMachine:
    """What a document with positions holds."""

    blocks: tuple[Placed, ...] = ()
    """The blocks that could be connected. Ids are places in the document, and may have gaps."""
    repaired: bool = False
    """Whether JSON had to be repaired."""
    notes: tuple[str, ...] = ()
    """What was passed over without harm, and parents that were ambiguous."""
    problems: tuple[Problem, ...] = ()
    """What keeps it from being file-valid."""
    loose: tuple[Problem, ...] = ()
    """Blocks that hang on nothing or are turned off the grid: spatially invalid."""

    @cached_property
    def machine(self) -> Machine | None:
        """The connected blocks, counted 0, 1, 2, ...; None when there are none."""
        return renumber(placed.step for placed in self.blocks)[0] if self.blocks else None


class _Face(NamedTuple):
    at: Units3
    facing: str
    block: int
    face: int


@lru_cache(maxsize=1024)
def facing_of(rotation: Quat) -> str | None:
    """Name of the one of the six orientations within 1 degree of a quaternion; None if none is."""
    length = math.sqrt(sum(part * part for part in rotation))
    if not length:
        return None
    for name, facing in FACINGS.items():
        agreement = abs(sum(a * b for a, b in zip(rotation, facing.quaternion, strict=True)))
        if agreement >= _CLOSEST * length:
            return name
    return None


def connect(
    spots: Sequence[LocatedBlock], *, repaired: bool = False, notes: Sequence[str] = ()
) -> LocatedMachine:
    """Find for every block the face of an earlier block that it hangs on (spec 1.3).

    The nearest face within 0.1 m counts, of those equally near the earliest. What finds none, or
    is turned off the grid, is left out with the reason, and so is what hangs on it.

    Args:
        spots: the Starting Block first; known standard types and, with `end`, two-ended ones.
        repaired: passed on.
        notes: passed on, before what is noted here.
    """
    joiner = _Joiner(spots[0].position)
    if facing_of(spots[0].rotation) != "z+":
        message = (
            f"block {spots[0].index} (Starting Block) is rotated; its rotation must be 0, 0, 0, 1"
        )
        joiner.loose.append(Problem("rotation", (spots[0].index,), message))
    joiner.settle(Step(spots[0].index, *_ROOT_REST))
    for spot in spots[1:]:
        joiner.join(spot)
    return LocatedMachine(
        tuple(joiner.placed.values()),
        repaired,
        (*notes, *joiner.notes),
        loose=tuple(joiner.loose),
    )


_ROOT_REST = (ROOT.type, ROOT.parent, ROOT.face_id)


@dataclass
class _Joiner:
    """A tree while it grows, and where its faces are."""

    origin: Vec3
    """Of the Starting Block, in the document's frame."""
    placed: dict[int, Placed] = field(default_factory=dict)
    faces: dict[Units3, list[_Face]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    loose: list[Problem] = field(default_factory=list)

    def join(self, spot: LocatedBlock) -> None:
        """Hang one block on the face that is where it is, or note why there is none."""
        if spot.end is not None:
            a, b = self._at(spot, spot.position, None), self._at(spot, spot.end, None)
            if a and b:
                self.settle(Step(spot.index, spot.type, a.block, a.face, b.block, b.face))
            return
        facing = facing_of(spot.rotation)
        if facing is None:
            turned = ", ".join(f"{part:g}" for part in spot.rotation)
            message = (
                f"{block_label(spot.index, spot.type)} has rotation {turned}, which is not within "
                f"{MAX_TURN:g} degree of any of the six orientations"
            )
            self.loose.append(Problem("rotation", (spot.index,), message))
            return
        found = self._at(spot, spot.position, facing)
        if found:
            self.settle(Step(spot.index, spot.type, found.block, found.face))

    def settle(self, step: Step) -> None:
        """Take a block in, with its faces."""
        placed = self.placed[step.id] = place_step(step, self.placed)
        for face in placed.shape.faces if placed.shape else ():
            x, y, z = at = add(placed.at, face.offset)
            entry = _Face(at, face.facing.name, step.id, face.id)
            cell = ((x + _HALF) // _CELL, (y + _HALF) // _CELL, (z + _HALF) // _CELL)
            self.faces.setdefault(cell, []).append(entry)

    def _at(self, spot: LocatedBlock, point: Vec3, facing: str | None) -> _Face | None:
        """The face at a point; None, with the problem noted, where there is none."""
        here = self._units(point)
        near = [
            (round(distance, 6), face.block, face.face, face)
            for face in self._around(here)
            if facing in (None, face.facing) and (distance := math.dist(here, face.at)) <= _REACH
        ]
        if not near:
            self.loose.append(self._nothing_at(spot, point, facing))
            return None
        near.sort()
        best = [face for distance, *_, face in near if distance == near[0][0]]
        if len(best) > 1:
            one, *others = (f"block {face.block} face {face.face}" for face in best)
            self.notes.append(
                f"{block_label(spot.index, spot.type)} has an ambiguous parent: {one} was chosen, "
                f"but {', '.join(others)} is equally near"
            )
        return best[0]

    def _around(self, here: Vec3) -> list[_Face]:
        """All faces that may be within reach."""
        x, y, z = (
            range(
                math.floor((part - _REACH + _HALF) / _CELL),
                math.floor((part + _REACH + _HALF) / _CELL) + 1,
            )
            for part in here
        )
        return [face for i in x for j in y for k in z for face in self.faces.get((i, j, k), ())]

    def _nothing_at(self, spot: LocatedBlock, point: Vec3, facing: str | None) -> Problem:
        that = f" that faces {facing}" if facing else ""
        message = (
            f"{block_label(spot.index, spot.type)} has no parent at {_told(point)}: no earlier "
            f"block has a face within {TOLERANCE} m{that}"
        )
        if len(self.loose) < MAX_HINTS:
            message += self._hint(self._units(point), facing)
        return Problem("no_parent", (spot.index,), message)

    def _hint(self, here: Vec3, facing: str | None) -> str:
        """The nearest face that faces this way, in words; "" where there is none."""
        known = (face for cell in self.faces.values() for face in cell)
        fitting = [face for face in known if facing in (None, face.facing)]
        if not fitting:
            return ""
        nearest = min(fitting, key=lambda face: (math.dist(here, face.at), face))
        where = _told(add_floats(self.origin, to_metres(nearest.at)))
        carrier = block_label(nearest.block, self.placed[nearest.block].type)
        return f"; the nearest such face is {nearest.face} of {carrier} at {where}"

    def _units(self, point: Vec3) -> Vec3:
        x, y, z = ((part - own) * UNITS for part, own in zip(point, self.origin, strict=True))
        return (x, y, z)


def add_floats(a: Vec3, b: Vec3) -> Vec3:
    """Sum of two points."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _told(point: Iterable[float]) -> str:
    return f"({', '.join(f'{round(part, 3):g}' for part in point)})"
