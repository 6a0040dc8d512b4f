"""Owns what a block type is: size, mass, faces, what it can do, all in the block's own frame.

Which types there are is blocks.py's and, for plates, plates.py's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Vec3 = tuple[float, float, float]

ROOTS = ("Root", "Plate")
"""Categories of what machines are built on."""
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
    """The numbers of a propeller's lift law."""

    lift_angle_deg: float
    axial_drag: float
    speed_cap: float
    """m/s."""


@dataclass(frozen=True, slots=True)
class BlockType:
    """One entry of the library. Directions are words in the block's own frame."""

    type: int
    name: str
    category: str
    size: Vec3 | None
    """Full extent along the block's own x, y, z in metres; None for two-ended blocks."""
    mass: float
    faces: tuple[Face, ...]
    """`faces[i].id == i`."""
    non_static: bool
    """Makes force or motion of its own."""
    non_stable: bool
    """Its connection to its parent moves."""
    linear: bool
    """Two-ended: hangs between two parents (brace, spring, winch)."""
    powered_wheel: bool
    linear_drag: float
    """1/s."""
    angular_drag: float
    """1/s."""
    extended: bool
    """Outside the 27 core types: legal only where a task lists it."""
    rotation_axis: str | None = None
    swing: tuple[str, ...] = ()
    angle_deg: tuple[float, float] | None = None
    grip_direction: str | None = None
    thrust: float | None = None
    """Newtons along its facing."""
    blade: Blade | None = None
    pitch_radius: float | None = None
    """Metres; cogs mesh where these circles touch."""
    closed: frozenset[int] = frozenset()
    """Ids of faces to which nothing can be attached."""

    @property
    def label(self) -> str:
        """Type id and name, as messages show it: "63 (Log)"."""
        return f"{self.type} ({self.name})"

    @property
    def root(self) -> bool:
        """Whether it is what machines are built on, and nothing else."""
        return self.category in ROOTS

    @property
    def open_faces(self) -> tuple[int, ...]:
        """Ids of the faces to which blocks can be attached, ascending."""
        return tuple(face.id for face in self.faces if face.id not in self.closed)
