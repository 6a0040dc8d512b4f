"""Converts machine files between formats."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from agentflow.app.machines.files import read_source
from agentflow.app.machines.formats import FORMATS, Format, Wishes, format_of
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.files.atomic import write_output
from agentflow.machine import Machine, Problem, check, library, place, spatial_problems
from agentflow.machine.blocks.plates import plate_of
from agentflow.machine.space import ANY_SIZE

NOTHING_ELSE = Wishes()


def convert(
    source: str, out: Path, wishes: Wishes = NOTHING_ELSE, *, strict: bool = False
) -> dict[str, Any]:
    """Read a machine in any format and write it in the format given by the suffix of `out`.

    Blocks that are not in the library, scaled, off the grid or unconnected are reported and
    skipped. A machine that is not spatially valid is written with a warning, if the format can.

    Args:
        source: File, run directory (its best machine), or `-` for standard input.
        out: File to write; its suffix is one of `formats.FORMATS`.
        wishes: The task whose scene is written as well, and how the machine is to be made; formats
            that hold nothing of it ignore it, with a note.
        strict: Refuse machines with skipped blocks or ambiguous parents, and invalid machines.
    """
    form = format_of(out)
    if form.needs == "task" and wishes.task is None:
        raise UsageError(f"{out} holds the scene of a task: name the task with --task")
    task = wishes.task if form.needs == "task" else None
    reading = read_source(source, tuple(library()))
    found = (*reading.problems, *reading.loose)
    problems = tuple(sorted(found, key=lambda problem: problem.blocks))
    machine = reading.machine
    if machine is None or (strict and problems):
        raise UsageError(f"{source} cannot be converted: {_summarize(problems)}")
    if len(machine) == 1 and problems:
        raise UsageError(
            f"{source} cannot be converted: only its Starting Block would remain: "
            f"{_summarize(problems)}"
        )
    if form.of_the_game and plate_of(machine[0].type):
        raise UsageError(
            f"{source} cannot be converted: it is built on a plate, which is not a block of the "
            "game; convert it to .json or .glb"
        )
    invalid = _problems(machine, task)
    if invalid and (strict or form.needs != "blocks"):
        raise UsageError(f"{source} is not a valid machine: {_summarize(invalid)}")
    data, losses = form.write(machine, wishes)
    with write_output(out) as part:
        part.write_bytes(data)
    return {
        "out": str(out),
        "blocks": len(machine),
        "left_out": [problem.to_json() for problem in problems],
        "notes": [*reading.notes, *_ignored(form, wishes), *losses],
        "warnings": [f"the machine is not valid: {_summarize(invalid)}"] if invalid else [],
    }


def _ignored(form: Format, wishes: Wishes) -> Iterator[str]:
    """Notes on options that change nothing in this format."""
    making = wishes.making
    given = {
        "--task": wishes.task,
        "--scale": making.scale,
        "--parts": making.parts and making.pegs is None,
        "--pegs": making.pegs,
    }
    for option, value in given.items():
        if value and option not in form.options:
            holding = [suffix for suffix, other in FORMATS.items() if option in other.options]
            yield f"{option} has no effect: it is for {' and '.join(holding)} files"


def _problems(machine: Machine, task: Task | None) -> tuple[Problem, ...]:
    """Why a file-valid machine is not valid, on this task if there is one."""
    if task is None:
        return tuple(spatial_problems(place(machine), ANY_SIZE))
    return check(machine, task.brief).problems


def _summarize(problems: tuple[Problem, ...]) -> str:
    """The first problem, preferably an unreadable number, and how many more there are."""
    first = min(problems, key=lambda problem: problem.code != "not_a_number")
    rest = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return first.message + rest
