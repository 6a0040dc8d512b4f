"""Write Besiege's machine files (.bsg), with keys of the game in place of a control program."""

import hashlib
import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from agentflow.machine.blocks.library import library
from agentflow.machine.controls import Lane, lanes
from agentflow.machine.formats.bsg_reading import END, END_TURN, START
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.pose import FACINGS, UNITS, Placed, to_metres
from agentflow.machine.problems import comma_list
from agentflow.machine.tree import Machine, shorten

KEYS = tuple(
    [f"Alpha{digit}" for digit in (*range(1, 10), 0)]
    + [f"Keypad{digit}" for digit in range(10)]
    + [chr(code) for code in range(ord("A"), ord("Z") + 1)]
)
"""Names of keys, as Unity calls them, in the order in which they are used."""
NO_KEY = "None"

Spans = tuple[tuple[float, float], ...]
"""From when to when a key is held, s."""


@dataclass(frozen=True)
class Binding:
    """The keys of blocks that the program drives alike."""

    blocks: tuple[int, ...]
    keys: tuple[str, str]
    """For levels above 0 and below; of grabbers, the second one opens them. `NO_KEY` for none."""
    held: tuple[Spans, Spans]

    def __str__(self) -> str:
        """What a player does."""
        held = "; ".join(
            f"{key} from {' and from '.join(map(_span_text, spans))}"
            for key, spans in zip(self.keys, self.held, strict=True)
            if spans
        )
        noun = "block" if len(self.blocks) == 1 else "blocks"
        return f"the game has no control programs: for {noun} {comma_list(self.blocks)} hold {held}"


def bind_keys(machine: Machine) -> tuple[Binding, ...]:
    """A binding for each lane of the program; without a key once all are used."""
    left = iter(KEYS)
    found = []
    for lane in lanes(machine):
        first, second = held = _held(lane)
        keys = next(left, NO_KEY) if first else NO_KEY, next(left, NO_KEY) if second else NO_KEY
        found.append(Binding(lane.blocks, keys, held))
    return tuple(found)


def _held(lane: Lane) -> tuple[Spans, Spans]:
    """When the first and the second key of a lane are held; grabbers have only the second."""
    if lane.rest:
        return (), _merged((begin, end) for begin, end, level in lane.spans if level <= 0.0)
    forward = _merged((begin, end) for begin, end, level in lane.spans if level > 0.0)
    return forward, _merged((begin, end) for begin, end, level in lane.spans if level < 0.0)


def _merged(spans: Iterable[tuple[float, float]]) -> Spans:
    """Spans in order of time, those that follow each other without a break as one."""
    merged: list[tuple[float, float]] = []
    for begin, end in spans:
        if merged and merged[-1][1] == begin:
            begin = merged.pop()[0]
        merged.append((begin, end))
    return tuple(merged)


def _span_text(span: tuple[float, float]) -> str:
    begin, end = map(shorten, span)
    return f"{begin} to {end} s"


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
