"""Block types: size, mass, faces and behaviour of one kind of block, in the block's own frame; and
plates, whose number encodes their size.

Every field is read from blocks.json. Numbers that were fitted to published rollouts (motor speed
and torque, friction, strength) are in env/constants.json, by type id.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from random import Random
from typing import Literal

from agentflow.errors import ConfigError
from agentflow.machine.geometry.vectors import Vec3

Color = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""

JointKind = Literal["fixed", "revolute", "prismatic", "spherical", "loose"]
Switch = Literal["motors", "steering_hinges", "decouplers"]
ShapeKind = Literal["box", "cylinder", "sphere", "hinge", "container", "caster", "plate"]
Connector = Literal["rod", "spring", "rope"]
Group = Literal[
    "motors", "steering_hinges", "thrusters", "springs", "winches", "grabbers", "decouplers"
]
"""Blocks that something drives, as control programs group them."""

ROOTS = ("Root", "Plate")
"""Categories of the blocks that machines are built on."""
DIRECTIONS: Mapping[str, tuple[int, int, int]] = {
    "Front": (0, 0, 1),
    "Back": (0, 0, -1),
    "Right": (1, 0, 0),
    "Left": (-1, 0, 0),
    "Up": (0, 1, 0),
    "Down": (0, -1, 0),
}
"""Unit vector of each direction word in a block's own frame (x right, y up, z front)."""


@dataclass(frozen=True, slots=True)
class Face:
    """A place where another block can be attached."""

    id: int
    position: Vec3
    """Metres, in the block's own frame, from its building point."""
    direction: str
    """Where a block attached here faces, in the block's own frame: a key of `DIRECTIONS`."""


@dataclass(frozen=True, slots=True)
class Blade:
    """Parameters of a propeller's lift law."""

    lift_angle_deg: float
    axial_drag: float
    """kg s/m2."""
    speed_cap: float
    """m/s."""


@dataclass(frozen=True, slots=True)
class Flame:
    """A flame that heats what it reaches."""

    direction: str
    """Where it is from the middle of its block."""
    reach: float
    """Distance from that middle to its own, m."""
    radius: float
    """m; it heats blocks whose middle is within."""


@dataclass(frozen=True, slots=True)
class JointType:
    """How a block is connected to its parent."""

    kind: JointKind = "fixed"
    """`prismatic` is sprung by the suspension_* constants; `loose` only rests on its parent."""
    axis: str = "Front"
    """Direction about which a revolute joint turns, along which a prismatic one slides."""
    stops_deg: tuple[float, float] | None = None
    """Lowest and highest angle; None: no stops."""
    switch: Switch = "motors"
    """Schedule entry that starts its motor; `decouplers` opens the joint."""
    motor_sense: int = 1
    """1 or -1: sense in which its motor turns about the axis."""

    @property
    def moves(self) -> bool:
        """Whether the block can move relative to its parent while connected to it."""
        return self.kind not in ("fixed", "loose")


@dataclass(frozen=True, slots=True)
class BlockType:
    """One entry of the library. Directions are words in the block's own frame."""

    type: int
    """Number of the type."""
    name: str
    """Name of the type, such as "Log"."""
    category: str
    """Kind of type, such as "Mechanical"."""
    size: Vec3 | None
    """Full extent along the block's own x, y, z in metres; None for two-ended blocks."""
    mass: float
    """kg."""
    faces: tuple[Face, ...]
    """`faces[i].id == i`."""
    color: Color
    """In pictures."""
    linear_drag: float = 0.0
    """1/s: the block loses mass * drag * velocity."""
    angular_drag: float = 0.0
    """1/s, about its own centre."""
    extended: bool = False
    """Not one of the 27 core types: legal only where a task lists it."""
    non_static: bool = False
    """Produces force or motion by itself."""
    non_stable: bool = False
    """Its connection to its parent moves or can be released."""
    powered_wheel: bool = False
    """When it faces x-, its motor is reversed to drive the same way as on the other side."""
    shape: ShapeKind = "box"
    """Its surface: cylinders lie about Front, hinges are flat plates across their axis, containers
    are open on Front, casters are a fork with a wheel."""
    joint: JointType = JointType()
    """Its connection to its parent; two-ended blocks have a fixed one at each end."""
    connector: Connector | None = None
    """Connection between the ends of a two-ended block; None for other blocks."""
    grip_direction: str | None = None
    """Side that grips what touches it."""
    thrust: float | None = None
    """Newtons, while motors are on."""
    blade: Blade | None = None
    """Lift law of a propeller blade; None for other blocks."""
    pitch_radius: float | None = None
    """Metres; cogs mesh where these circles touch."""
    counterpart: int | None = None
    """Type of the same size with a motor, or without one if this has a motor."""
    motor_name: str | None = None
    """Plural noun for schedule sentences about what motors start to turn."""
    schedule_text: str | None = None
    """Further schedule sentence about it, for designers; `{motors:g}`, `{springs:g}` and
    `{steering_hinges:g}` stand for start times, s."""
    bsg: tuple[tuple[str, str, str], ...] = ()
    """Tag, key and value of its settings in Besiege's machine files."""
    keys: tuple[str, ...] = field(default=(), repr=False)
    """Its settings there that bind keys: for levels above 0, then below; "" for none. Libraries are
    hashed without them."""
    closed: frozenset[int] = frozenset()
    """Ids of faces to which nothing can be attached."""
    # Fields that came later: no part of repr, from which digests of recorded runs were made.
    push: str = field(default="Front", repr=False)
    """Direction of its thrust."""
    steam: float | None = field(default=None, repr=False)
    """Factor of its thrust while a flame heats it; None: flames do not change it."""
    flame: Flame | None = field(default=None, repr=False)
    """A flame that always burns; None for other blocks."""

    @property
    def label(self) -> str:
        """Type id and name, as messages show it: "63 (Log)"."""
        return f"{self.type} ({self.name})"

    @property
    def linear(self) -> bool:
        """Whether it is two-ended and connects two parents: brace, spring, winch."""
        return self.connector is not None

    @property
    def group(self) -> Group | None:
        """The group of driven blocks that it belongs to; None if nothing drives it."""
        if self.thrust is not None:
            return "thrusters"
        if self.grip_direction is not None:
            return "grabbers"
        if self.connector == "spring":
            return "springs"
        if self.connector == "rope":
            return "winches"
        motor = self.non_static and self.joint.kind == "revolute"
        return self.joint.switch if motor or self.joint.switch == "decouplers" else None

    @property
    def parts(self) -> int:
        """Rigid bodies that physics makes of it: the ends of a two-ended block, the fork and wheel
        of a caster."""
        return 2 if self.linear or self.shape == "caster" else 1

    @property
    def root(self) -> bool:
        """Whether machines are built on it; it is never attached to anything."""
        return self.category in ROOTS

    @property
    def open_faces(self) -> tuple[int, ...]:
        """Ids of the faces to which blocks can be attached, ascending."""
        return tuple(face.id for face in self.faces if face.id not in self.closed)


GRID = 0.5
"""Spacing of the faces, m."""
THICKNESS = 0.5
"""m."""
DENSITY = 1.0
"""kg per square metre; cogs that turn on a plate this heavy do not move it."""
COLOR = (0.56, 0.6, 0.62, 1.0)
HOLE = 2.0
"""Width of a hole, m."""
SIZES, HOLES, PATTERNS = (5, 31), (0, 20), (0, 9)
"""Ranges of the width (whole metres), the number of holes and the pattern."""


@dataclass(frozen=True)
class Plate:
    """A square plate in the x-z plane.

    Its faces lie on all points of a 0.5 m grid inside it, point Up and are numbered row by row,
    x first, from the corner with the lowest x and z. Holes are 2 m squares with their centres on
    the grid; nothing can be attached to faces within a hole or on its rim.
    """

    size: int
    """Width along x and z, m."""
    holes: int = 0
    pattern: int = 0
    """One of ten random arrangements of the holes."""

    @property
    def type(self) -> int:
        """Its type number: the size, two digits for the holes, one for the pattern."""
        return 1000 * self.size + 10 * self.holes + self.pattern

    @property
    def row_length(self) -> int:
        """Faces in a row."""
        return 2 * self.size - 1

    def face(self, x: float, z: float) -> int:
        """The face at x and z, m from the plate's middle.

        Raises:
            ConfigError: The place is off the plate or over a hole.
        """
        column, line = (round(part / GRID) + self.row_length // 2 for part in (x, z))
        if not (0 <= column < self.row_length and 0 <= line < self.row_length):
            raise ConfigError(f"x = {x:g}, z = {z:g} m is not on a plate {self.size} m wide")
        face = line * self.row_length + column
        if face in plate_type(self.type).closed:
            raise ConfigError(f"x = {x:g}, z = {z:g} m is over a hole of the plate")
        return face

    def face_position(self, face: int) -> tuple[float, float]:
        """x and z of a face, m from the plate's middle."""
        line, column = divmod(face, self.row_length)
        return (column - self.row_length // 2) * GRID, (line - self.row_length // 2) * GRID

    @property
    def hole_centres(self) -> tuple[tuple[float, float], ...]:
        """x and z of the middle of each hole, m; holes touch neither each other nor the edge."""
        rng = Random(f"plate {self.type}")
        centres: list[tuple[int, int]] = []
        limit = self.row_length // 2 - 4
        places = [(x, z) for x in range(-limit, limit + 1, 2) for z in range(-limit, limit + 1, 2)]
        rng.shuffle(places)
        for x, z in places:
            if len(centres) == self.holes:
                break
            if all(max(abs(x - u), abs(z - v)) > 6 for u, v in centres):
                centres.append((x, z))
        return tuple((x * GRID, z * GRID) for x, z in sorted(centres))

    def block_type(self) -> BlockType:
        """The plate as a block type."""
        centres = self.hole_centres
        places = [self.face_position(face) for face in range(self.row_length**2)]
        closed = {
            face
            for face, (x, z) in enumerate(places)
            for u, v in centres
            if max(abs(x - u), abs(z - v)) <= HOLE / 2
        }
        return BlockType(
            type=self.type,
            name="Plate",
            category="Plate",
            size=(float(self.size), THICKNESS, float(self.size)),
            mass=DENSITY * self.size**2,
            faces=tuple(Face(i, (x, THICKNESS / 2, z), "Up") for i, (x, z) in enumerate(places)),
            color=COLOR,
            shape="plate",
            extended=True,
            closed=frozenset(closed),
        )


def plate_of(block_type: int) -> Plate | None:
    """The plate with this type number; None if no plate has it."""
    if block_type < 1000:  # nearly always
        return None
    size, rest = divmod(block_type, 1000)
    plate = Plate(size, *divmod(rest, 10))
    ranges = ((size, SIZES), (plate.holes, HOLES), (plate.pattern, PATTERNS))
    return plate if all(low <= value <= high for value, (low, high) in ranges) else None


@lru_cache(maxsize=32)
def plate_type(block_type: int) -> BlockType:
    """The plate of this number as a block type.

    Raises:
        KeyError: No plate has this number.
    """
    plate = plate_of(block_type)
    if plate is None:
        raise KeyError(block_type)
    return plate.block_type()
