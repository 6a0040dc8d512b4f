"""Write Besiege's machine files (.bsg)."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from agentflow.machine.blocks.library import library
from agentflow.machine.formats.bsg_keys import NO_KEY, bind_keys
from agentflow.machine.formats.bsg_reading import END, END_TURN, START
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.pose import FACINGS, UNITS, Placed, to_metres
from agentflow.machine.tree import Machine

GROUND = 0.5
"""Height of the ground in the game world, in metres."""

_ORIGIN = (0.0, 0.0, 0.0)
Setting = tuple[str, str, str]
"""Tag, key and value."""


def to_bsg(machine: Machine) -> str:
    """A file-valid machine as the text of a .bsg file.

    Equal machines give equal text; GUIDs are derived from the digest. Blocks that a control program
    drives get keys in place of starting by themselves: see `bsg_keys`.
    """
    geometry = place(machine)
    lo, hi = geometry.lo, geometry.hi
    root = Element("Machine", version="1", bsgVersion="1.3", name=machine.digest)
    world = SubElement(root, "Global")
    x, z = (-(lo[axis] + hi[axis]) / (2 * UNITS) for axis in (0, 2))
    _vector(world, "Position", (x, GROUND - lo[1] / UNITS, z))
    _vector(world, "Rotation", FACINGS["z+"].quaternion)
    blocks = SubElement(root, "Blocks")
    keys = {block: bound.keys for bound in bind_keys(machine) for block in bound.blocks}
    for placed in geometry.blocks:
        digest = hashlib.sha256(f"{machine.digest}/{placed.id}".encode()).digest()
        settings = _settings(placed)
        if machine.controlled:
            settings = _bound(settings, placed, keys.get(placed.id, (NO_KEY, NO_KEY)))
        _write_block(blocks, placed, settings, str(uuid.UUID(bytes=digest[:16], version=4)))
    indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, "unicode") + "\n"


def _settings(placed: Placed) -> tuple[Setting, ...]:
    block_type = library()[placed.type]
    flipped = block_type.powered_wheel and placed.facing == "x-"
    return (*block_type.bsg, ("Boolean", "flipped", "True")) if flipped else block_type.bsg


def _bound(
    settings: tuple[Setting, ...], placed: Placed, keys: tuple[str, str]
) -> tuple[Setting, ...]:
    """Settings with these keys, of a block that does not start by itself."""
    bound = {
        name: key for name, key in zip(library()[placed.type].keys, keys, strict=False) if name
    }
    kept = [
        (tag, name, "False" if name == "bmt-automatic" else value)
        for tag, name, value in settings
        if name not in bound
    ]
    return (*kept, *(("StringArray", name, key) for name, key in bound.items()))


def _write_block(blocks: Element, placed: Placed, settings: tuple[Setting, ...], guid: str) -> None:
    block = SubElement(blocks, "Block", id=str(placed.type), guid=guid)
    transform = SubElement(block, "Transform")
    _vector(transform, "Position", placed.origin)
    _vector(transform, "Rotation", placed.quaternion)
    _vector(transform, "Scale", (1.0, 1.0, 1.0))
    data = SubElement(block, "Data")
    for tag, key, value in settings:
        entry = SubElement(data, tag, key=key)
        (SubElement(entry, "String") if tag == "StringArray" else entry).text = value
    if placed.far is not None:
        (x, y, z), (u, v, w) = placed.at, placed.far
        reach = to_metres((u - x, v - y, w - z))
        for key, vector in ((START, _ORIGIN), (END, reach), (END_TURN, _ORIGIN)):
            entry = SubElement(data, "Vector3", key=key)
            for name, part in zip("XYZ", vector, strict=True):
                SubElement(entry, name).text = f"{part:.9g}"


def _vector(parent: Element, tag: str, values: Iterable[float]) -> None:
    parts = {name: f"{value:.9g}" for name, value in zip("xyzw", values, strict=False)}
    SubElement(parent, tag, parts)
