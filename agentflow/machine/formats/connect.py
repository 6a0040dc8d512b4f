"""Infer the construction tree of blocks that are given by position and rotation."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

from agentflow.machine.formats.parse import Reading
from agentflow.machine.geometry.placement import place_step
from agentflow.machine.geometry.pose import FACINGS, UNITS, Placed, Units3, to_metres
from agentflow.machine.geometry.vectors import Quat, Vec3, add
from agentflow.machine.problems import Problem, block_label
from agentflow.machine.tree import ROOT, Step, renumber

TOLERANCE = 0.1
"""Maximum distance of a block from the face that it is attached to, in metres."""
MAX_TURN = 1.0
"""Maximum deviation from one of the six orientations, in degrees."""
MAX_HINTS = 10
"""Maximum number of problems that name the nearest face, which is slow to find."""

_CELL = 10
"""Width of the cells of the face index, in units. Faces lie on a grid of this width, so that cells
are centred on them."""
_HALF = _CELL // 2
_CLOSEST = math.cos(math.radians(MAX_TURN) / 2) - 1e-12
_REACH = TOLERANCE * UNITS + 1e-6


@dataclass(frozen=True, slots=True)
class LocatedBlock:
    """A block given by position. Metres, in the document's frame."""

    index: int
    """Index in the document, from 0."""
    type: int
    position: Vec3
    """Building point; the first end of a two-ended block."""
    rotation: Quat
    """(x, y, z, w), of any length but 0; ignored for two-ended blocks."""
    end: Vec3 | None = None
    """Second end of a two-ended block."""

    @property
    def label(self) -> str:
        """The block in messages."""
        return block_label(self.index, self.type)


class _Face(NamedTuple):
    at: Units3
    facing: str
    block: int
    face: int


@lru_cache(maxsize=1024)
def facing_of(rotation: Quat) -> str | None:
    """The orientation within 1 degree of a quaternion, by name; None if there is none."""
    length = math.sqrt(sum(part * part for part in rotation))
    for name, facing in FACINGS.items() if length else ():
        agreement = abs(sum(a * b for a, b in zip(rotation, facing.quaternion, strict=True)))
        if agreement >= _CLOSEST * length:
            return name
    return None


def connect(
    blocks: Sequence[LocatedBlock], *, repaired: bool = False, notes: Sequence[str] = ()
) -> Reading:
    """Attach every block to a face of an earlier block.

    The nearest face within 0.1 m is the parent; the earliest if several are equally near. Blocks
    without a parent or with an illegal rotation are left out, with a problem, and so is everything
    attached to them.

    Args:
        blocks: Starting Block first; two-ended types have an `end`, standard types do not.
        repaired: copied to the result.
        notes: copied to the result, before any new notes.
    """
    connector = _Connector(blocks[0].position)
    if facing_of(blocks[0].rotation) != "z+":
        message = f"{blocks[0].label} is rotated; its rotation must be 0, 0, 0, 1"
        connector.loose.append(Problem("rotation", (blocks[0].index,), message))
    connector.place(replace(ROOT, id=blocks[0].index))
    for block in blocks[1:]:
        connector.attach(block)
    placed = tuple(connector.placed.values())
    return Reading(
        renumber(block.step for block in placed)[0],
        repaired,
        (*notes, *connector.notes),
        blocks=placed,
        loose=tuple(connector.loose),
    )


@dataclass
class _Connector:
    """A growing tree, with an index of its faces by position."""

    origin: Vec3
    """Position of the Starting Block in the document's frame."""
    placed: dict[int, Placed] = field(default_factory=dict)
    faces: dict[Units3, list[_Face]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    loose: list[Problem] = field(default_factory=list)

    def attach(self, block: LocatedBlock) -> None:
        """Attach one block to the face at its position, or add a problem."""
        if block.end is not None:
            a, b = self._face_at(block, block.position, None), self._face_at(block, block.end, None)
            if a and b:
                self.place(Step(block.index, block.type, a.block, a.face, b.block, b.face))
            return
        facing = facing_of(block.rotation)
        if facing is None:
            turned = ", ".join(f"{part:g}" for part in block.rotation)
            message = (
                f"{block.label} has rotation {turned}, which is not within "
                f"{MAX_TURN:g} degree of any of the six orientations"
            )
            self.loose.append(Problem("rotation", (block.index,), message))
            return
        found = self._face_at(block, block.position, facing)
        if found:
            self.place(Step(block.index, block.type, found.block, found.face))

    def place(self, step: Step) -> None:
        """Add an attached block and its faces."""
        placed = self.placed[step.id] = place_step(step, self.placed)
        for face in placed.shape.faces if placed.shape else ():
            x, y, z = at = add(placed.at, face.offset)
            entry = _Face(at, face.facing.name, step.id, face.id)
            cell = ((x + _HALF) // _CELL, (y + _HALF) // _CELL, (z + _HALF) // _CELL)
            self.faces.setdefault(cell, []).append(entry)

    def _face_at(self, block: LocatedBlock, point: Vec3, facing: str | None) -> _Face | None:
        """The face at a point; None, and a problem, if there is none."""
        at = self._units(point)
        near = [
            (round(distance, 6), face.block, face.face, face)
            for face in self._faces_near(at)
            if facing in (None, face.facing) and (distance := math.dist(at, face.at)) <= _REACH
        ]
        if not near:
            self.loose.append(self._no_parent(block, point, facing))
            return None
        near.sort()
        best = [face for distance, *_, face in near if distance == near[0][0]]
        if len(best) > 1:
            one, *others = (f"block {face.block} face {face.face}" for face in best)
            self.notes.append(
                f"{block.label} has an ambiguous parent: {one} was chosen, "
                f"but {', '.join(others)} is equally near"
            )
        return best[0]

    def _faces_near(self, at: Vec3) -> list[_Face]:
        """All faces that may be within the tolerance."""
        low, high = (
            [math.floor((part + away + _HALF) / _CELL) for part in at] for away in (-_REACH, _REACH)
        )
        cells = product(*(range(a, b + 1) for a, b in zip(low, high, strict=True)))
        return [face for i, j, k in cells for face in self.faces.get((i, j, k), ())]

    def _no_parent(self, block: LocatedBlock, point: Vec3, facing: str | None) -> Problem:
        that = f" that faces {facing}" if facing else ""
        message = (
            f"{block.label} has no parent at {_point_text(point)}: no earlier "
            f"block has a face within {TOLERANCE} m{that}"
        )
        if len(self.loose) < MAX_HINTS:
            message += self._nearest_face(self._units(point), facing)
        return Problem("no_parent", (block.index,), message)

    def _nearest_face(self, at: Vec3, facing: str | None) -> str:
        """The nearest face with this facing, in words; "" if there is none."""
        known = (face for cell in self.faces.values() for face in cell)
        fitting = [face for face in known if facing in (None, face.facing)]
        if not fitting:
            return ""
        nearest = min(fitting, key=lambda face: (math.dist(at, face.at), face))
        where = _point_text(add(self.origin, to_metres(nearest.at)))
        carrier = self.placed[nearest.block].label
        return f"; the nearest such face is {nearest.face} of {carrier} at {where}"

    def _units(self, point: Vec3) -> Vec3:
        x, y, z = ((part - own) * UNITS for part, own in zip(point, self.origin, strict=True))
        return (x, y, z)


def _point_text(point: Iterable[float]) -> str:
    return f"({', '.join(f'{round(part, 3):g}' for part in point)})"
