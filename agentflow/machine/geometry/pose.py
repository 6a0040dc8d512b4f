"""Poses of single blocks: the six orientations, oriented block types, placed blocks.

All arithmetic is exact, on integers in units of 0.05 m.
"""

from functools import lru_cache
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.vectors import Quat, Vec3, add, scale
from agentflow.machine.problems import block_label
from agentflow.machine.tree import Step

UNITS = 20
"""Units per metre; every legal coordinate is a multiple of 0.05 m."""

Units3 = tuple[int, int, int]

_S = 0.5**0.5


class Facing(NamedTuple):
    """One of the six orientations: a block's own axes in the machine frame."""

    name: str
    """Machine axis that its front points along: "x+", "x-", "y+", "y-", "z+", "z-"."""
    front: Units3
    right: Units3
    up: Units3
    quaternion: Quat

    def turn(self, vector: Units3) -> Units3:
        """Rotate a vector from the block's own frame to the machine frame."""
        x, y, z = vector
        right, up, front = self.right, self.up, self.front
        return (
            x * right[0] + y * up[0] + z * front[0],
            x * right[1] + y * up[1] + z * front[1],
            x * right[2] + y * up[2] + z * front[2],
        )


FACINGS: dict[str, Facing] = {
    facing.name: facing
    for facing in (
        Facing("z+", (0, 0, 1), (1, 0, 0), (0, 1, 0), (0.0, 0.0, 0.0, 1.0)),
        Facing("z-", (0, 0, -1), (-1, 0, 0), (0, 1, 0), (0.0, 1.0, 0.0, 0.0)),
        Facing("x+", (1, 0, 0), (0, 0, -1), (0, 1, 0), (0.0, _S, 0.0, _S)),
        Facing("x-", (-1, 0, 0), (0, 0, 1), (0, 1, 0), (0.0, -_S, 0.0, _S)),
        Facing("y+", (0, 1, 0), (1, 0, 0), (0, 0, -1), (-_S, 0.0, 0.0, _S)),
        Facing("y-", (0, -1, 0), (1, 0, 0), (0, 0, 1), (_S, 0.0, 0.0, _S)),
    )
}

_BY_FRONT = {facing.front: facing for facing in FACINGS.values()}


class ShapeFace(NamedTuple):
    """A face of an oriented block, relative to its building point, in units."""

    id: int
    offset: Units3
    facing: Facing


class BlockShape(NamedTuple):
    """A block type in one of the six orientations, relative to its building point, in units."""

    facing: Facing
    lo: Units3
    hi: Units3
    faces: tuple[ShapeFace, ...]


@lru_cache(maxsize=512)
def shape(block_type: int, facing: str) -> BlockShape:
    """A standard block type in one orientation; the root is centred on its building point."""
    block = library()[block_type]
    assert block.size is not None
    turn = FACINGS[facing].turn
    x, y, z = (_exact(extent / 2) for extent in block.size)
    back = -z if block.root else 0
    lo, hi = box_of(turn((-x, -y, back)), turn((x, y, back + 2 * z)))
    faces = tuple(
        ShapeFace(
            face.id,
            turn((_exact(face.position[0]), _exact(face.position[1]), _exact(face.position[2]))),
            _BY_FRONT[turn(DIRECTIONS[face.direction])],
        )
        for face in block.faces
    )
    return BlockShape(FACINGS[facing], lo, hi, faces)


def box_of(a: Units3, b: Units3) -> tuple[Units3, Units3]:
    """The lowest and the highest corner of the box between two points."""
    lo = (min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2]))
    return lo, (max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2]))


def _exact(metres: float) -> int:
    units = round(metres * UNITS)
    if abs(metres * UNITS - units) > 1e-6:
        raise ValueError(f"{metres} m is not a multiple of {1 / UNITS} m")
    return units


def to_metres(units: Units3) -> Vec3:
    """Convert units of 0.05 m to metres."""
    return (units[0] / UNITS, units[1] / UNITS, units[2] / UNITS)


class PlacedFace(NamedTuple):
    """A face in the machine frame."""

    face_id: int
    position: Vec3
    facing: str
    """Outward normal, and the facing of a block attached here."""


class Placed(NamedTuple):
    """A placed block. Machine frame: left-handed, x right, y up, z forward.

    Fields are in units, properties in metres. A two-ended block has no faces; its box spans its
    ends and its facing is z+.
    """

    step: Step
    at: Units3
    lo: Units3
    hi: Units3
    shape: BlockShape | None
    """None for a two-ended block."""
    far: Units3 | None = None
    """Second end of a two-ended block."""

    @property
    def id(self) -> int:
        """Block id."""
        return self.step.id

    @property
    def type(self) -> int:
        """Block type."""
        return self.step.type

    @property
    def name(self) -> str:
        """Name of the block type."""
        return library()[self.step.type].name

    @property
    def label(self) -> str:
        """The block in messages."""
        return block_label(self.id, self.type)

    @property
    def two_ended(self) -> bool:
        """Whether it connects two parents."""
        return self.far is not None

    @property
    def orientation(self) -> Facing:
        """The block's own axes in the machine frame."""
        return self.shape.facing if self.shape else FACINGS["z+"]

    @property
    def origin(self) -> Vec3:
        """Building point, where it is attached; the first end of a two-ended block."""
        return to_metres(self.at)

    @property
    def facing(self) -> str:
        """Machine axis that its front points along."""
        return self.orientation.name

    @property
    def right(self) -> Vec3:
        """Its own x axis."""
        return _floats(self.orientation.right)

    @property
    def up(self) -> Vec3:
        """Its own y axis."""
        return _floats(self.orientation.up)

    @property
    def front(self) -> Vec3:
        """Its own z axis."""
        return _floats(self.orientation.front)

    def direction(self, word: str) -> Vec3:
        """Unit vector of a direction word in the machine frame."""
        return self.turn(DIRECTIONS[word])

    def turn(self, local: Vec3) -> Vec3:
        """A vector of its own frame in the machine frame."""
        sides = add(scale(self.right, local[0]), scale(self.up, local[1]))
        return add(sides, scale(self.front, local[2]))

    @property
    def quaternion(self) -> Quat:
        """Its orientation as (x, y, z, w)."""
        return self.orientation.quaternion

    @property
    def box_min(self) -> Vec3:
        """Lowest x, y, z of its axis-aligned box."""
        return to_metres(self.lo)

    @property
    def box_max(self) -> Vec3:
        """Highest x, y, z of its axis-aligned box."""
        return to_metres(self.hi)

    @property
    def center(self) -> Vec3:
        """Centre of its box; midpoint of a two-ended block."""
        lo, hi = self.lo, self.hi
        twice = 2 * UNITS
        return ((lo[0] + hi[0]) / twice, (lo[1] + hi[1]) / twice, (lo[2] + hi[2]) / twice)

    @property
    def faces(self) -> tuple[PlacedFace, ...]:
        """Its faces, by face id; () for a two-ended block."""
        if self.shape is None:
            return ()
        return tuple(
            PlacedFace(face.id, to_metres(add(self.at, face.offset)), face.facing.name)
            for face in self.shape.faces
        )

    @property
    def end_a(self) -> Vec3 | None:
        """First end of a two-ended block; None for other blocks."""
        return to_metres(self.at) if self.far is not None else None

    @property
    def end_b(self) -> Vec3 | None:
        """Second end of a two-ended block; None for other blocks."""
        return to_metres(self.far) if self.far is not None else None

    def to_json(self) -> dict[str, object]:
        """The block as JSON data."""
        data: dict[str, object] = {"id": self.id, "type": self.type}
        if self.far is not None:
            return data | {"end_a": list(to_metres(self.at)), "end_b": list(to_metres(self.far))}
        return data | {
            "position": list(self.origin),
            "center": list(self.center),
            "orientation": self.facing,
            "quaternion": list(self.quaternion),
            "box_min": list(self.box_min),
            "box_max": list(self.box_max),
            "faces": [{**face._asdict(), "position": list(face.position)} for face in self.faces],
        }


def _floats(vector: Units3) -> Vec3:
    return (float(vector[0]), float(vector[1]), float(vector[2]))
