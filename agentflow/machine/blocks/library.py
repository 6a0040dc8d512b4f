"""Owns the block library: the 35 block types as blocks.json describes them, loaded once.

What a block type is, is blocktype.py's; where a block ends up in a machine geometry.py's; how it
behaves the environment's.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from agentflow.errors import UnknownNameError
from agentflow.machine.blocks.plates import plate_type
from agentflow.machine.blocks.types import DIRECTIONS, Blade, BlockType, Face, Vec3

STARTING_BLOCK = 0
DECOUPLER = 4
BRACE = 7
SUSPENSION = 16
GRABBER = 27
CONTAINER = 30
BOULDER = 36
POWERED_COG = 39


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
        return plate_type(block_type) if found is None else found

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
