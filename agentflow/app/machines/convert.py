"""Converts machine files between formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agentflow.app.machines.files import read_source
from agentflow.app.machines.formats import FORMATS, Format, format_of
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.files.atomic import write_output
from agentflow.machine import Machine, Problem, check, library, place, spatial_problems
from agentflow.machine.blocks.plates import plate_of


def convert(
    source: str, out: Path, *, task: Task | None = None, strict: bool = False
) -> dict[str, Any]:
    """Read a machine in any format and write it in the format given by the suffix of `out`.

    Blocks that are not in the library, scaled, off the grid or unconnected are reported and
    skipped. A machine that is not spatially valid is written with a warning, if the format can.

    Args:
        source: File, run directory (its best machine), or `-` for standard input.
        out: File to write; its suffix is one of `formats.FORMATS`.
        task: The task whose scene is written as well; formats that hold none ignore it.
        strict: Refuse machines with skipped blocks or ambiguous parents, and invalid machines.
    """
    form = format_of(out)
    ignored = _unused_task(form, task, out)
    task = None if ignored else task
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
    data, losses = form.write(machine, task)
    with write_output(out) as part:
        part.write_bytes(data)
    return {
        "out": str(out),
        "blocks": len(machine),
        "left_out": [problem.to_json() for problem in problems],
        "notes": [*reading.notes, *ignored, *losses],
        "warnings": [f"the machine is not valid: {_summarize(invalid)}"] if invalid else [],
    }


def _unused_task(form: Format, task: Task | None, out: Path) -> list[str]:
    """A note on a task that the file does not hold; raises UsageError if it needs one."""
    if form.needs == "task" and task is None:
        raise UsageError(f"{out} holds the scene of a task: name the task with --task")
    if form.needs == "task" or task is None:
        return []
    holding = [suffix for suffix, other in FORMATS.items() if other.needs == "task"]
    return [f"--task has no effect: only {' and '.join(holding)} files hold a task"]


def _problems(machine: Machine, task: Task | None) -> tuple[Problem, ...]:
    """Why a file-valid machine is not valid, on this task if there is one."""
    if task is None:
        return tuple(spatial_problems(place(machine)))
    return check(machine, task.brief).problems


def _summarize(problems: tuple[Problem, ...]) -> str:
    """The first problem, preferably an unreadable number, and how many more there are."""
    first = min(problems, key=lambda problem: problem.code != "not_a_number")
    rest = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return first.message + rest
