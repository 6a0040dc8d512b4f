"""Place the blocks of a construction tree: poses, boxes, free faces and closed loops; and raised
banks under machines.

All arithmetic is exact, on integers in units of 0.05 m.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.pose import Placed, Units3, box_of, shape, to_metres
from agentflow.machine.geometry.vectors import Vec3, add, subtract
from agentflow.machine.tree import Machine, Step


class AutoConnection(NamedTuple):
    """A closed loop: the front of a block meets a face of a block that is not its parent."""

    block: int
    face_id: int
    """Always 0, the front."""
    partner: int
    partner_face: int


@dataclass(frozen=True)
class Geometry:
    """Placed blocks. Machine frame: left-handed, x right, y up, z forward, metres."""

    blocks: tuple[Placed, ...]
    """Sorted by id; ids may have gaps during edits and where blocks are missing."""
    banks: tuple[Bank, ...] = ()
    """What the machine is set down on besides the ground."""

    def __getitem__(self, block_id: int) -> Placed:
        return self._by_id[block_id]

    def children(self, block_id: int) -> tuple[int, ...]:
        """Ids of the standard blocks attached to a block, ascending."""
        return tuple(child for child, _ in self._children[block_id])

    def children_by_face(self, block_id: int) -> tuple[tuple[int, int], ...]:
        """(face id, child id) of the standard blocks attached to a block, by child id."""
        return tuple((face, child) for child, face in self._children[block_id])

    def free_faces(self, block_id: int) -> tuple[int, ...]:
        """Ids of a block's faces without a standard block, ascending."""
        taken = {face for _, face in self._children[block_id]}
        faces = library()[self[block_id].type].open_faces
        return tuple(face for face in faces if face not in taken)

    @property
    def lo(self) -> Units3:
        """Lowest x, y, z of all boxes, in units."""
        return self._bounds[0]

    @property
    def hi(self) -> Units3:
        """Highest x, y, z of all boxes, in units."""
        return self._bounds[1]

    @property
    def box_min(self) -> Vec3:
        """Lowest x, y, z of all boxes; two-ended blocks do not count."""
        return to_metres(self.lo)

    @property
    def box_max(self) -> Vec3:
        """Highest x, y, z of all boxes; two-ended blocks do not count."""
        return to_metres(self.hi)

    @property
    def size(self) -> Vec3:
        """Extent of the union of all boxes along x, y, z."""
        lo, hi = self._bounds
        return to_metres((hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]))

    @cached_property
    def height(self) -> float:
        """How low the machine can be set down on banks and ground: y of its lowest point, m."""
        lifts = (
            self._lift(placed, bank)
            for placed in self.blocks
            for bank in self.banks
            if bank.is_under(placed, self.middle)
        )
        return max((0.0, *lifts))

    @property
    def middle(self) -> Vec3:
        """The middle of the bounding box."""
        (a, b, c), (x, y, z) = self.box_min, self.box_max
        return ((a + x) / 2, (b + y) / 2, (c + z) / 2)

    def banks_under(self, block_id: int) -> list[Bank]:
        """The banks that a block rests on as the machine is set down."""
        placed = self[block_id]
        return [
            bank
            for bank in self.banks
            if bank.is_under(placed, self.middle)
            and abs(self._lift(placed, bank) - self.height) < BESIDE
        ]

    def _lift(self, placed: Placed, bank: Bank) -> float:
        """y of the lowest point of the machine where a block lies on a bank, m."""
        return bank.top - (placed.box_min[1] - self.box_min[1])

    @cached_property
    def overlaps(self) -> tuple[tuple[int, int], ...]:
        """Id pairs of blocks whose boxes intersect, lower id first, sorted; see `overlapping`."""
        return tuple(overlapping(self.blocks))

    @cached_property
    def auto_connections(self) -> tuple[AutoConnection, ...]:
        """Closed loops, sorted; two fronts that meet form one loop."""
        meeting: dict[tuple[Units3, Units3], list[tuple[int, int]]] = {}
        for placed in self.blocks:
            x, y, z = placed.at
            for face in placed.shape.faces if placed.shape else ():
                a, b, c = face.offset
                key = (x + a, y + b, z + c), face.facing.front
                meeting.setdefault(key, []).append((placed.id, face.id))
        found: set[AutoConnection] = set()
        for placed in self.blocks:
            if placed.shape is None or not placed.shape.faces or not _grips(placed.type):
                continue
            front = placed.shape.faces[0]
            x, y, z = front.facing.front
            for partner, face_id in meeting.get((add(placed.at, front.offset), (-x, -y, -z)), ()):
                other = self[partner].step
                if other.parent == placed.id or placed.step.parent == partner:
                    continue
                if AutoConnection(partner, face_id, placed.id, 0) not in found:
                    found.add(AutoConnection(placed.id, 0, partner, face_id))
        return tuple(sorted(found))

    def to_json(self) -> list[dict[str, object]]:
        """All blocks as JSON data."""
        return [placed.to_json() for placed in self.blocks]

    @cached_property
    def _by_id(self) -> dict[int, Placed]:
        return {placed.id: placed for placed in self.blocks}

    @cached_property
    def _children(self) -> dict[int, list[tuple[int, int]]]:
        children: dict[int, list[tuple[int, int]]] = {placed.id: [] for placed in self.blocks}
        for placed in self.blocks:
            if not placed.two_ended and placed.step.parent >= 0:
                children[placed.step.parent].append((placed.id, placed.step.face_id))
        return children

    @cached_property
    def _bounds(self) -> tuple[Units3, Units3]:
        return bounds(self.blocks)


def _grips(block_type: int) -> bool:
    """Whether the front of this type connects automatically: rigid and powered blocks do."""
    block = library()[block_type]
    return not block.non_stable or block.non_static


_last: tuple[Machine | None, Geometry] = None, Geometry(())
"""The machine that was placed last: it is often placed again."""


def place(steps: Machine | Iterable[Step], banks: tuple[Bank, ...] = ()) -> Geometry:
    """Place the steps of a file-valid machine, or steps whose ids have gaps.

    Args:
        steps: The machine.
        banks: What it is set down on besides the ground.
    """
    global _last
    last, geometry = _last
    if steps is last and geometry.banks == banks:
        return geometry
    placed: dict[int, Placed] = {}
    for step in steps:
        placed[step.id] = place_step(step, placed)
    geometry = Geometry(tuple(placed.values()), banks)
    if isinstance(steps, Machine):
        _last = steps, geometry
    return geometry


def place_step(step: Step, placed: Mapping[int, Placed]) -> Placed:
    """Place one step on blocks that are already placed."""
    if step.parent_b is not None and step.face_id_b is not None:
        a = face_at(placed[step.parent], step.face_id)
        b = face_at(placed[step.parent_b], step.face_id_b)
        return Placed(step, a, *box_of(a, b), None, b)
    if step.parent < 0:
        x, y, z = 0, 0, 0
        turned = shape(step.type, "z+")
    else:
        parent = placed[step.parent]
        assert parent.shape is not None
        _, (dx, dy, dz), facing = parent.shape.faces[step.face_id]
        x, y, z = parent.at
        x, y, z = x + dx, y + dy, z + dz
        turned = shape(step.type, facing.name)
    _, (x0, y0, z0), (x1, y1, z1), _ = turned
    return Placed(step, (x, y, z), (x + x0, y + y0, z + z0), (x + x1, y + y1, z + z1), turned)


def face_at(parent: Placed, face_id: int) -> Units3:
    """Where a face of a block is."""
    assert parent.shape is not None
    return add(parent.at, parent.shape.faces[face_id].offset)


def mirrored_face(parent: Placed, face_id: int, image: Placed) -> int | None:
    """The face of an image that is where the mirror image of a block's face would be, in the plane
    x = 0; None without one."""
    if parent.shape is None or image.shape is None:
        return None
    wanted = flip(face_at(parent, face_id)), flip(parent.shape.faces[face_id].facing.front)
    found = (
        face.id
        for face in image.shape.faces
        if (face_at(image, face.id), face.facing.front) == wanted
    )
    return next(found, None)


def flip(point: Units3) -> Units3:
    """A point or direction with left and right exchanged."""
    return (-point[0], point[1], point[2])


def bounds(blocks: Iterable[Placed]) -> tuple[Units3, Units3]:
    """Lowest and highest corner of all boxes, in units; two-ended blocks have no box."""
    boxes = [(lo, hi) for _, _, lo, hi, turned, _ in blocks if turned is not None]
    x0, y0, z0 = (min(lo[axis] for lo, _ in boxes) for axis in range(3))
    x1, y1, z1 = (max(hi[axis] for _, hi in boxes) for axis in range(3))
    return (x0, y0, z0), (x1, y1, z1)


def overlapping(blocks: Iterable[Placed]) -> list[tuple[int, int]]:
    """Id pairs of standard blocks whose boxes intersect, lower id first, sorted.

    Touching boxes do not count, nor does a container with its direct child.
    """
    containers = library().containers
    boxes = [
        (*lo, *hi, step.id, step.parent, step.type in containers)
        for step, _, lo, hi, turned, _ in blocks
        if turned is not None
    ]
    boxes.sort()
    pairs = []
    for i, (_, y0, z0, x1, y1, z1, a, parent_a, holds_a) in enumerate(boxes, 1):
        for j in range(i, len(boxes)):
            u0, v0, w0, _, v1, w1, b, parent_b, holds_b = boxes[j]
            if u0 >= x1:
                break
            if v0 < y1 and y0 < v1 and w0 < z1 and z0 < w1:
                if (holds_a and parent_b == a) or (holds_b and parent_a == b):
                    continue
                pairs.append((a, b) if a < b else (b, a))
    pairs.sort()
    return pairs


def overlap_of(a: Placed, b: Placed) -> Vec3:
    """Extent of the intersection of two boxes along x, y, z, metres; negative for gaps."""
    x, y, z = (min(a.hi[axis], b.hi[axis]) - max(a.lo[axis], b.lo[axis]) for axis in range(3))
    return to_metres((x, y, z))


BESIDE = 1e-6
"""What overlaps by less only touches, m."""


class Bank(NamedTuple):
    """A box along the axes, on the top of which machines are set down.

    The middle of a machine's bounding box is over x = z = 0.
    """

    name: str
    top: float
    """y, m; the ground around it is at y = 0."""
    low: tuple[float, float]
    """Least x and z, m."""
    high: tuple[float, float]
    """Greatest x and z, m."""

    def is_under(self, placed: Placed, middle: Vec3) -> bool:
        """Whether a block is above or below its top, with the machine's middle over x = z = 0."""
        low, high = subtract(placed.box_min, middle), subtract(placed.box_max, middle)
        return not placed.two_ended and all(
            low[axis] < greatest - BESIDE and high[axis] > least + BESIDE
            for axis, least, greatest in zip((0, 2), self.low, self.high, strict=True)
        )

    def reaches(self, point: Vec3, middle: Vec3) -> bool:
        """Whether a point (machine frame, m) is above or below its top or at its edge."""
        place = subtract(point, middle)
        return all(
            least - BESIDE <= place[axis] <= greatest + BESIDE
            for axis, least, greatest in zip((0, 2), self.low, self.high, strict=True)
        )
