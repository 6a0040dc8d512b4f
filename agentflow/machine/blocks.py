"""Owns the block library: the 35 block types as blocks.json describes them, loaded once.

Where a block ends up in a machine is geometry.py's; how it behaves is the environment's.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from agentflow.errors import UnknownNameError

Vec3 = tuple[float, float, float]

STARTING_BLOCK = 0
ROOTS = ("Root", "Plate")
"""Categories of what machines are built on."""
GRABBER = 27
CONTAINER = 30
BOULDER = 36

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


class Library(Mapping[int, BlockType]):
    """All block types by type id, ascending.

    Plates (plates.py) are found by their number as well, but are not among those listed.
    """

    def __init__(self, types: Mapping[int, BlockType]) -> None:
        self._types = dict(sorted(types.items()))
        self.core = tuple(key for key, block in self._types.items() if not block.extended)
        """Type ids that are legal where a task lists nothing else."""
        self.extended = tuple(key for key, block in self._types.items() if block.extended)

    def __getitem__(self, block_type: int) -> BlockType:
        found = self._types.get(block_type)
        if found is not None:
            return found
        from agentflow.machine.plates import plate_type  # which is made of what is defined here

        return plate_type(block_type)

    def __iter__(self) -> Iterator[int]:
        return iter(self._types)

    def __len__(self) -> int:
        return len(self._types)

    def find(self, name_or_id: int | str) -> BlockType:
        """The type of this id or name; letter case, spaces, dashes and underscores do not count.

        Raises:
            UnknownNameError: no such type; names the nearest ones.
        """
        text = str(name_or_id).strip()
        if text.isascii() and text.isdigit() and len(text) < 10:
            number = int(text)
            if number in self._types:
                return self._types[number]
            raise UnknownNameError("block type", text, self.nearest(number))
        wanted = _plain(text)
        for block in self._types.values():
            if _plain(block.name) == wanted:
                return block
        raise UnknownNameError("block type", text, [block.name for block in self._types.values()])

    def nearest(self, number: int) -> list[str]:
        """Labels of all types, those with the nearest type ids first."""
        order = sorted(self._types, key=lambda key: (abs(key - number), key))
        return [self._types[key].label for key in order]


def _plain(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


@cache
def library() -> Library:
    """The block library that ships with the package, read on first use."""
    text = Path(__file__).with_name("blocks.json").read_text(encoding="utf-8")
    return load_library(json.loads(text))


def load_library(entries: list[dict[str, Any]]) -> Library:
    """Build a library from the entries of blocks.json.

    Raises:
        ValueError: an entry is wrong; the message names the type and the field.
    """
    types: dict[int, BlockType] = {}
    for entry in entries:
        block = _block_type(entry)
        if block.type in types:
            raise ValueError(f"block type {block.type} is defined twice")
        types[block.type] = block
    return Library(types)


def _block_type(entry: dict[str, Any]) -> BlockType:
    try:
        flags = entry["flags"]
        block = BlockType(
            type=entry["type"],
            name=entry["name"],
            category=entry["category"],
            size=_optional(entry, "size_xyz", _vec3),
            mass=float(entry["mass"]),
            faces=tuple(
                Face(face["id"], _vec3(face["position"]), face["direction"])
                for face in entry["faces"]
            ),
            non_static=flags["non_static"],
            non_stable=flags["non_stable"],
            linear=flags["linear"],
            powered_wheel=flags["powered_wheel"],
            linear_drag=float(entry["linear_drag"]),
            angular_drag=float(entry["angular_drag"]),
            extended=entry["set"] == "extended",
            rotation_axis=entry.get("rotation_axis"),
            swing=tuple(entry.get("swing", ())),
            angle_deg=_optional(entry, "angle_deg", lambda pair: (float(pair[0]), float(pair[1]))),
            grip_direction=entry.get("grip_direction"),
            thrust=_optional(entry, "thrust", float),
            blade=_optional(entry, "blade", lambda blade: Blade(**blade)),
            pitch_radius=_optional(entry, "pitch_radius", float),
        )
    except (KeyError, TypeError) as error:
        raise ValueError(
            f"block type {entry.get('type')}: wrong or missing field {error}"
        ) from None
    _check(block)
    return block


def _check(block: BlockType) -> None:
    if block.linear != (block.size is None):
        raise ValueError(f"block type {block.label}: two-ended blocks and only they have no size")
    if [face.id for face in block.faces] != list(range(len(block.faces))):
        raise ValueError(f"block type {block.label}: face ids must count 0, 1, 2, ...")
    if any(face.direction not in DIRECTIONS for face in block.faces):
        raise ValueError(f"block type {block.label}: face directions are {', '.join(DIRECTIONS)}")
    if block.mass <= 0:
        raise ValueError(f"block type {block.label}: mass must be positive")


def _vec3(values: list[float]) -> Vec3:
    x, y, z = values
    return (float(x), float(y), float(z))


def _optional(entry: dict[str, Any], key: str, convert: Callable[[Any], Any]) -> Any:
    return convert(entry[key]) if key in entry else None
