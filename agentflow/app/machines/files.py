"""Reading and checking machines without physics, and showing the block library."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, AnyStr, TextIO

from agentflow.env.physics.engines import AUTO, choose_engine, engine_limits
from agentflow.errors import RunError, UsageError
from agentflow.machine import BlockType, Brief, Machine, library, place
from agentflow.machine import check as check_machine
from agentflow.machine.formats.detect import Form, read_any, read_for

UTF_16_MARKS = (b"\xff\xfe", b"\xfe\xff")
LARGEST = 64 * 2**20
"""Most bytes of a text (characters for standard input); refuses endless files."""
NO_MACHINE = ("not_json", "not_xml", "not_a_machine")
"""Problem codes of texts that are not machines."""


def read_text(source: str) -> str:
    """The text of a file, or of standard input for `-`; UTF-8, or UTF-16 with a byte order mark."""
    if source == "-":
        return _limit_size(_standard_input().read(LARGEST + 1), "standard input")
    try:
        with Path(source).open("rb") as file:
            data = _limit_size(file.read(LARGEST + 1), source)
        return data.decode("utf-16" if data.startswith(UTF_16_MARKS) else "utf-8-sig")
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{source} is not a text file") from None


def _limit_size(data: AnyStr, source: str) -> AnyStr:
    if len(data) > LARGEST:
        raise UsageError(f"{source} is larger than {LARGEST // 2**20} MB; expected a machine")
    return data


def read_lines(source: str) -> Iterator[str]:
    """The lines of a file, or of standard input for `-`, including blank ones."""
    if source == "-":
        yield from _standard_input()
        return
    try:
        with Path(source).open(encoding="utf-8-sig", errors="replace") as lines:
            yield from lines
    except OSError as error:
        raise UsageError(f"cannot read {source}: {error.strerror}") from None


def _standard_input() -> TextIO:
    """Standard input as UTF-8; invalid bytes are replaced."""
    if sys.stdin is None:
        raise UsageError("standard input is closed; name a file")
    if isinstance(sys.stdin, io.TextIOWrapper):
        sys.stdin.reconfigure(encoding="utf-8-sig", errors="replace")
    return sys.stdin


def machine_text(source: str) -> str:
    """The text of one machine in any format; of a run directory, that of its best machine.

    A .bsg file must have that format; the format of other files is detected.

    Raises:
        UsageError: The file cannot be read or holds no machine.
        RunError: The directory is not a finished run with a valid machine.
    """
    text = _best_machine(Path(source)) if Path(source).is_dir() else read_text(source)
    form: Form = "bsg" if source.lower().endswith(".bsg") else "auto"
    problem = next((p for p in read_any(text, form).problems if p.code in NO_MACHINE), None)
    if problem is not None:
        place = "standard input" if source == "-" else source
        raise UsageError(f"{place} contains no machine: {problem.message}")
    return text


def _best_machine(run: Path) -> str:
    from agentflow.runs import read_document, read_result  # not needed to check a file

    read_document(run)  # refuses edited runs and links
    machine = read_result(run).get("machine")
    if machine is None:
        raise RunError(f"{run} has no valid machine")
    return json.dumps(machine)


def read_one(source: str) -> Machine:
    """The machine of a file or run, in any format.

    Raises:
        UsageError: It cannot be read, or is not file-valid.
    """
    reading = read_any(machine_text(source), blocks=tuple(library()))
    if reading.machine is None or reading.problems or reading.loose:
        raise UsageError(f"{source}: {(*reading.problems, *reading.loose)[0].message}")
    return reading.machine


def check(
    source: object,
    brief: Brief | None,
    geometry: bool,
    form: Form = "auto",
    engine: str | None = None,
) -> dict[str, Any]:
    """The validity report and the warnings as data.

    Args:
        source: Text or JSON data.
        brief: The task, if any.
        geometry: Whether to add the position of every block.
        form: Format of the text.
        engine: Name of the physics engine whose limits count without a task.
    """
    limits = engine_limits(choose_engine(engine or AUTO).name) if brief is None else brief.limits
    report = check_machine(read_for(brief, source, form), brief, limits)
    warnings = [warning.to_json() for warning in report.warnings]
    answer: dict[str, Any] = {**report.to_json(), "warnings": warnings}
    if geometry:
        machine = report.machine
        answer["blocks"] = [] if machine is None else place(machine).to_json()
    return answer


def is_flawless(report: Mapping[str, Any]) -> bool:
    """Whether a report of `check` has no problem, no warning and no repaired text."""
    return not (report["problems"] or report["warnings"] or report["repaired"])


def check_lines(
    lines: Iterable[str],
    brief: Brief | None,
    geometry: bool,
    form: Form = "auto",
    engine: str | None = None,
) -> Iterator[dict[str, Any]]:
    """One report per line, in order; a line that is not JSON is checked as model text."""
    for line in lines:
        yield check(parse_line(line), brief, geometry, form, engine)


def parse_line(line: str) -> object:
    """A line of a `.jsonl` file: JSON data, or the line itself if it is not JSON."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return line


def list_blocks() -> list[dict[str, Any]]:
    """Every block type of the library as data, by id."""
    return [block_json(block) for block in library().values()]


def find_block(name: str) -> dict[str, Any]:
    """One block type by id or name."""
    return block_json(library().find(name))


def block_json(block: BlockType) -> dict[str, Any]:
    """A block type as data, in metres and kilograms."""
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
