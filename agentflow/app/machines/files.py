"""Reading and checking machines without physics, and showing the block library."""

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from agentflow.env.physics.engine import AUTO
from agentflow.env.physics.engines import choose_engine, engine_limits
from agentflow.errors import RunError, UsageError
from agentflow.machine import BlockType, Brief, Machine, library, place
from agentflow.machine import check as check_machine
from agentflow.machine.formats.detect import Form, read_any, read_for, read_text
from agentflow.machine.formats.parse import Reading

NO_MACHINE = ("not_json", "not_xml", "not_a_machine")
"""Problem codes of texts that are not machines."""


def machine_text(source: str) -> str:
    """The text of one machine in any format; of a run directory, that of its best machine.

    A .bsg file must have that format; the format of other files is detected.

    Raises:
        UsageError: The file cannot be read or holds no machine.
        RunError: The directory is not a finished run with a valid machine.
    """
    text = _text_of(source)
    _read(text, source)
    return text


def read_source(source: str, rules: Brief | Collection[int] | None = None) -> Reading:
    """The reading of one machine; `source` and errors as for `machine_text`.

    Args:
        source: The file or run.
        rules: Those of a task, or the allowed block types; the core types if None.
    """
    return _read(_text_of(source), source, rules)


def _text_of(source: str) -> str:
    return _best_machine_text(Path(source)) if Path(source).is_dir() else read_text(source)


def _read(text: str, source: str, rules: Brief | Collection[int] | None = None) -> Reading:
    form: Form = "bsg" if source.lower().endswith(".bsg") else "auto"
    if isinstance(rules, Brief):
        reading = read_for(rules, text, form)
    else:
        reading = read_any(text, form, rules)
    for problem in reading.problems:
        if problem.code in NO_MACHINE:
            place = "standard input" if source == "-" else source
            raise UsageError(f"{place} contains no machine: {problem.message}")
    return reading


def _best_machine_text(run: Path) -> str:
    from agentflow.runs import read_document, read_result  # not needed to check a file

    read_document(run)  # refuses edited runs and links
    machine = read_result(run).machine
    if machine is None:
        raise RunError(f"{run} has no valid machine")
    return json.dumps(machine)


def read_one(source: str) -> Machine:
    """The machine of a file or run, in any format.

    Raises:
        UsageError: It cannot be read, or is not file-valid.
    """
    reading = read_source(source, tuple(library()))
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
    if brief is not None:
        answer |= {"task": brief.name, "rules_met": report.rules_met}
    if geometry:
        machine = report.machine
        answer["blocks"] = [] if machine is None else place(machine).to_json()
    return answer


def is_flawless(report: Mapping[str, Any]) -> bool:
    """Whether a report of `check` has no problem, no warning and no repaired text."""
    return not (report["problems"] or report["warnings"] or report["repaired"])


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
