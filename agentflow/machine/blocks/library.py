"""The block library: the block types of blocks.json, loaded once."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from agentflow.errors import UnknownNameError
from agentflow.machine.blocks.types import (
    Blade,
    BlockType,
    Color,
    Face,
    Flame,
    JointType,
    plate_type,
)
from agentflow.machine.geometry.vectors import Vec3

STARTING_BLOCK = 0
"""Type of the first block of every machine that is not built on a plate."""
EXAMPLE = 15
"""Type used in examples of formats, if the task allows it."""
BRACE, GRABBER, CONTAINER, BOULDER = 7, 27, 30, 36
"""Types that task rules refer to."""
STEERING = frozenset({13, 28})
"""Steering Block and Steering Hinge."""
TORCH, WATER_CANNON = 47, 56
LATER = frozenset({TORCH, WATER_CANNON})
"""Extended types that came after the first runs were recorded, which must not change by them."""


class Library(Mapping[int, BlockType]):
    """All block types by type id, ascending.

    Plates (plates.py) can be looked up by their number too, but are not listed.
    """

    def __init__(self, types: Mapping[int, BlockType]) -> None:
        self._types = dict(sorted(types.items()))
        self.core = tuple(key for key, block in self._types.items() if not block.extended)
        """Type ids that are legal unless a task lists others."""
        self.containers = frozenset(
            key for key, block in self._types.items() if block.shape == "container"
        )
        """Type ids of blocks that may overlap with the blocks that they hold."""

    @cached_property
    def digest(self) -> str:
        """Hash of all that affects geometry and physics, 16 hex digits; no texts or colours.

        The types of `LATER` are left out: recorded runs hold the digest of the others.
        """
        blank: Any = {"name": "", "color": (), "motor_name": None, "schedule_text": None, "bsg": ()}
        first = (block for block in self._types.values() if block.type not in LATER)
        content = repr([replace(block, **blank) for block in first])
        return hashlib.sha256(content.encode()).hexdigest()[:16]

    def __getitem__(self, block_type: int) -> BlockType:
        found = self._types.get(block_type)
        return plate_type(block_type) if found is None else found

    def __iter__(self) -> Iterator[int]:
        return iter(self._types)

    def __len__(self) -> int:
        return len(self._types)

    def find(self, name_or_id: int | str) -> BlockType:
        """The type with this id or name; case, spaces, dashes and underscores are ignored.

        Raises:
            UnknownNameError: There is no such type; the message lists the nearest.
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
        """Labels of all types, nearest type ids first."""
        order = sorted(self._types, key=lambda key: (abs(key - number), key))
        return [self._types[key].label for key in order]


def _plain(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


@cache
def library() -> Library:
    """The block library that ships with the package, read on first use.

    An entry of blocks.json has the fields of `BlockType`, with `size_xyz` for the size, `set`
    ("core" or "extended") and `flags`, the names of the fields that are true; `colors` has the
    colour of each category.
    """
    text = Path(__file__).with_name("blocks.json").read_text(encoding="utf-8")
    document = json.loads(text)
    types = (_block_type(entry, document["colors"]) for entry in document["blocks"])
    return Library({block.type: block for block in types})


def _block_type(entry: dict[str, Any], colors: dict[str, Color]) -> BlockType:
    fields = {key: _READ[key](value) if key in _READ else value for key, value in entry.items()}
    fields |= dict.fromkeys(fields.pop("flags"), True)
    return BlockType(
        size=fields.pop("size_xyz", None),
        color=tuple(fields.pop("color", colors[entry["category"]])),
        extended=fields.pop("set") == "extended",
        **fields,
    )


def _vec3(values: list[float]) -> Vec3:
    x, y, z = values
    return (float(x), float(y), float(z))


def _joint(entry: dict[str, Any]) -> JointType:
    stops = entry.get("stops_deg")
    return JointType(**{**entry, "stops_deg": None if stops is None else tuple(map(float, stops))})


def _faces(entries: list[dict[str, Any]]) -> tuple[Face, ...]:
    return tuple(Face(face["id"], _vec3(face["position"]), face["direction"]) for face in entries)


_READ: dict[str, Callable[[Any], Any]] = {
    "size_xyz": _vec3,
    "faces": _faces,
    "joint": _joint,
    "blade": lambda blade: Blade(**blade),
    "flame": lambda flame: Flame(**flame),
    "bsg": lambda settings: tuple(tuple(setting) for setting in settings),
    "keys": tuple,
    **dict.fromkeys(("mass", "linear_drag", "angular_drag"), float),
    **dict.fromkeys(("thrust", "steam", "pitch_radius"), float),
}
"""Converters of entry fields; fields not listed are taken unchanged."""
