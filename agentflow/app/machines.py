"""Owns what is done with machines without physics: read them, check them, show the library."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from agentflow.errors import UsageError
from agentflow.machine import BlockType, Brief, Geometry, library, place
from agentflow.machine import check as judge


def read_text(source: str) -> str:
    """The text of a file, or of standard input for `-`.

    Raises:
        UsageError: There is no such file, or it is no text.
    """
    if source == "-":
        return sys.stdin.read()
    try:
        return Path(source).read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{source} is not a text file") from None


def read_lines(source: str) -> Iterator[str]:
    """The lines of a file or of standard input, one at a time, without blank ones.

    Raises:
        UsageError: There is no such file.
    """
    if source == "-":
        yield from (line for line in sys.stdin if line.strip())
        return
    try:
        with Path(source).open(encoding="utf-8", errors="replace") as lines:
            yield from (line for line in lines if line.strip())
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None


def machine_text(source: str) -> str:
    """The text of one machine, which must hold a JSON list somewhere.

    Raises:
        UsageError: It holds none; names the file.
    """
    text = read_text(source)
    problem = next((p for p in judge(text).problems if p.code == "not_json"), None)
    if problem is not None:
        place = "standard input" if source == "-" else source
        raise UsageError(f"{place} holds no machine: {problem.message}")
    return text


def check(source: object, brief: Brief | None, geometry: bool) -> dict[str, Any]:
    """The validity report of spec 1.12; `source` is any model text or JSON data."""
    report = judge(source, brief)  # type: ignore[arg-type]
    answer: dict[str, Any] = report.to_json()
    if geometry:
        machine = report.machine
        answer["blocks"] = [] if machine is None else blocks_json(place(machine))
    return answer


def check_lines(
    lines: Iterable[str], brief: Brief | None, geometry: bool
) -> Iterator[dict[str, Any]]:
    """One report per line, in order; a line that is no JSON is judged as model text."""
    for line in lines:
        yield check(line_value(line), brief, geometry)


def line_value(line: str) -> object:
    """A line of a `.jsonl` file: JSON data, or the line itself where it is none."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return line


def blocks_json(geometry: Geometry) -> list[dict[str, Any]]:
    """Where every block is, with the keys of spec 1.12; metres, game frame."""
    items: list[dict[str, Any]] = []
    for block in geometry.blocks:
        item: dict[str, Any] = {"id": block.id, "type": block.type}
        if block.two_ended:
            item |= {"end_a": block.end_a, "end_b": block.end_b}
        else:
            item |= {
                "position": block.origin,
                "center": block.center,
                "orientation": block.facing,
                "quaternion": block.quaternion,
                "box_min": block.box_min,
                "box_max": block.box_max,
                "faces": [
                    {"face_id": face.face_id, "position": face.position, "facing": face.facing}
                    for face in block.faces
                ],
            }
        items.append(item)
    return items


def block_list() -> list[dict[str, Any]]:
    """Every block type of the library as data, ascending."""
    return [block_json(block) for block in library().values()]


def find_block(name: str) -> dict[str, Any]:
    """One block type by id or name.

    Raises:
        UnknownNameError: There is none; lists the nearest.
    """
    return block_json(library().find(name))


def block_json(block: BlockType) -> dict[str, Any]:
    """A block type as data: metres, kilograms."""
    return {
        "type": block.type,
        "name": block.name,
        "category": block.category,
        "size": block.size,
        "mass": block.mass,
        "extended": block.extended,
        "two_ended": block.linear,
        "faces": [
            {"face_id": face.id, "position": face.position, "direction": face.direction}
            for face in block.faces
        ],
    }
