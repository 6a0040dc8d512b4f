"""Owns what is done with machines without physics: read them, check them, show the library."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, AnyStr, TextIO

from agentflow.errors import UsageError
from agentflow.machine import BlockType, Brief, library, place
from agentflow.machine import check as judge
from agentflow.machine.formats.detect import Form, read_any, read_for

UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
LARGEST = 64 * 2**20
"""Bytes (characters of standard input) of one text; an endless file is refused, not read."""
NO_MACHINE = ("not_json", "not_xml", "not_a_machine")
"""Codes of problems that say that a text is something else."""


def read_text(source: str) -> str:
    """The text of a file, or of standard input for `-`; UTF-8, or UTF-16 with its mark.

    Raises:
        UsageError: There is no such file, it is no text, or it is far too large.
    """
    if source == "-":
        return _bounded(_standard_input().read(LARGEST + 1), "standard input")
    try:
        with Path(source).open("rb") as file:
            data = _bounded(file.read(LARGEST + 1), source)
        return data.decode("utf-16" if data.startswith(UTF_16_MARKS) else "utf-8-sig")
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{source} is not a text file") from None


def _bounded(data: AnyStr, source: str) -> AnyStr:
    if len(data) > LARGEST:
        raise UsageError(f"{source} is larger than {LARGEST // 2**20} MB; no machine is")
    return data


def read_lines(source: str) -> Iterator[str]:
    """The lines of a file or of standard input, one at a time, blank ones too.

    Raises:
        UsageError: There is no such file.
    """
    if source == "-":
        yield from _standard_input()
        return
    try:
        with Path(source).open(encoding="utf-8-sig", errors="replace") as lines:
            yield from lines
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None


def _standard_input() -> TextIO:
    """Standard input as UTF-8; what is none of it is replaced."""
    if sys.stdin is None:
        raise UsageError("standard input is closed; name a file")
    if isinstance(sys.stdin, io.TextIOWrapper):
        sys.stdin.reconfigure(encoding="utf-8-sig", errors="replace")
    return sys.stdin


def machine_text(source: str) -> str:
    """The text of one machine, in any form; a text that holds none at all is an error.

    A file that ends in .bsg is to hold that form; any other holds what it looks like.

    Raises:
        UsageError: It holds none; names the file.
    """
    text = read_text(source)
    form: Form = "bsg" if source.lower().endswith(".bsg") else "auto"
    problem = next((p for p in read_any(text, form).problems if p.code in NO_MACHINE), None)
    if problem is not None:
        place = "standard input" if source == "-" else source
        raise UsageError(f"{place} holds no machine: {problem.message}")
    return text


def check(
    source: object, brief: Brief | None, geometry: bool, form: Form = "auto"
) -> dict[str, Any]:
    """The validity report of spec 1.12; `source` is any model text or JSON data."""
    report = judge(read_for(brief, source, form), brief)
    answer: dict[str, Any] = report.to_json()
    if geometry:
        machine = report.machine
        answer["blocks"] = [] if machine is None else place(machine).to_json()
    return answer


def warnings(text: str, brief: Brief | None, form: Form = "auto") -> list[str]:
    """What a check has to say of a machine that does not make it invalid."""
    report = judge(read_for(brief, text, form), brief)
    return [warning.message for warning in report.warnings]


def check_lines(
    lines: Iterable[str], brief: Brief | None, geometry: bool, form: Form = "auto"
) -> Iterator[dict[str, Any]]:
    """One report per line, in order; a line that is no JSON is judged as model text."""
    for line in lines:
        yield check(line_value(line), brief, geometry, form)


def line_value(line: str) -> object:
    """A line of a `.jsonl` file: JSON data, or the line itself where it is none."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return line


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
