"""Converts machine files between formats, known by suffix, and to parts lists, instructions and
what one makes them from."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from agentflow.app.machines.files import read_one, read_source
from agentflow.env.drawing.glb import machine_glb
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.base import Task
from agentflow.env.urdf import machine_urdf
from agentflow.errors import UsageError
from agentflow.extras import needs_extra
from agentflow.files.atomic import write_file
from agentflow.machine import Machine, Problem, check, library, place, spatial_problems
from agentflow.machine.blocks.types import plate_of
from agentflow.machine.formats.bsg_writing import bind_keys, to_bsg
from agentflow.machine.formats.coordinates import to_coordinates
from agentflow.machine.geometry.pieces import build_order
from agentflow.machine.tree import lines_of
from agentflow.machine.validity import ANY_SIZE
from agentflow.making.guide import COLUMNS, bill, bill_csv, guide, steps_of
from agentflow.making.parts import USUAL, Making
from agentflow.metrics.tables import Column, Row, Table, markdown

HEADS, NUMBERS = COLUMNS[:3], COLUMNS[3:]
GUIDE = ".html"
MADE: Mapping[str, str] = {GUIDE: "", ".step": "OCP", ".3mf": "trimesh"}
"""Suffix -> the library that it needs beside agentflow, or ""."""


def list_parts(source: str, out: Path | None = None) -> dict[str, Any]:
    """The parts list of a machine as data; also written to a .csv or .md file.

    Args:
        source: File, run directory (its best machine), or `-` for standard input.
        out: File to write.
    """
    machine = read_one(source)
    rows = bill(machine)
    if out is not None:
        suffix = out.suffix.lower()
        if suffix not in (".csv", ".md"):
            raise UsageError(f"cannot write {out}: a parts list is a .csv or .md file")
        write_file(out, bill_csv(machine) if suffix == ".csv" else _markdown(rows))
    return {
        "rows": rows,
        "blocks": sum(row["number"] for row in rows),
        "mass": round(sum(row["total_mass"] for row in rows), 6),
    }


def _markdown(rows: list[dict[str, Any]]) -> str:
    lines = (
        Row(tuple(str(row[key]) for key in HEADS), tuple(row[key] for key in NUMBERS))
        for row in rows
    )
    return markdown(Table("Parts", HEADS, tuple(Column("", key) for key in NUMBERS), tuple(lines)))


def write_guide(source: str, out: Path) -> dict[str, Any]:
    """Write the page that shows how a machine is put together.

    Args:
        source: File, run directory (its best machine), or `-` for standard input.
        out: .html file to write.

    Raises:
        UsageError: The machine is not valid, or cannot be built in any order.
    """
    if out.suffix.lower() != ".html":
        raise UsageError(f"cannot write {out}: instructions are an .html file")
    machine = read_one(source)
    order = _order(machine, source)
    page = guide(machine, order, Path(source).stem if source != "-" else "machine")
    write_file(out, page)
    return {"out": str(out), "blocks": len(machine), "steps": list(map(list, steps_of(order)))}


def made_file(machine: Machine, suffix: str) -> bytes:
    """The file of a machine for those who make it: one of `MADE`.

    Raises:
        UsageError: The machine is not valid; for instructions, it cannot be built in any order.
        ConfigError: The libraries that write it are not installed.
    """
    order = _order(machine, "the machine", suffix == GUIDE)
    if suffix == GUIDE:
        return guide(machine, order, f"machine {machine.digest}").encode()
    return FORMATS[suffix].write(machine, Wishes())[0]


def _order(machine: Machine, name: str, in_order: bool = True) -> tuple[int, ...]:
    """The order in which a valid machine is built; () unless it is asked for."""
    geometry = place(machine)
    for problem in spatial_problems(geometry, ANY_SIZE):
        raise UsageError(f"{name} is not a valid machine: {problem.message}")
    order = build_order(geometry) if in_order else ()
    if isinstance(order, Problem):
        raise UsageError(f"{name}: {order.message}")
    return order


Written = tuple[bytes, tuple[str, ...]]
"""Content of a file, and what it cannot hold, one sentence each."""


@dataclass(frozen=True)
class Wishes:
    """What a file is to hold besides the machine, and how the machine is to be made."""

    task: Task | None = None
    making: Making = USUAL


@dataclass(frozen=True)
class Format:
    """A file format.

    What it `needs`: `blocks` is any file-valid machine; `task` is the scene of a task as well, on
    which the machine must be valid. `of_the_game` says whether its machines begin with the Starting
    Block, and `options` which options change what it holds.
    """

    write: Callable[[Machine, Wishes], Written]
    needs: Literal["blocks", "valid machine", "task"] = "blocks"
    of_the_game: bool = False
    options: tuple[str, ...] = ()


def _document(write: Callable[[Machine], bytes | str]) -> Callable[[Machine, Wishes], Written]:
    """A writer of files that hold everything."""

    def written(machine: Machine, _: Wishes) -> Written:
        content = write(machine)
        return content.encode() if isinstance(content, str) else content, ()

    return written


def _bsg(machine: Machine, _: Wishes) -> Written:
    """With the keys that a player holds in place of the control program."""
    senses = ("the game has no controllers: blocks that follow one get no keys",)
    return to_bsg(machine).encode(), (
        *map(str, bind_keys(machine)),
        *(senses if machine.controllers else ()),
    )


def _mjcf(machine: Machine, wishes: Wishes) -> Written:
    """As the MuJoCo engine builds it, which is loaded by name, as engines are."""
    _ = ENGINES["mujoco"].identity  # says what to install
    module = import_module("agentflow.env.physics.mujoco.export.mjcf")
    written: Written = module.machine_mjcf(machine, wishes.task)
    return written


def _made(module: str, name: str, *options: str) -> Format:
    """A format of what can be made; the libraries of an extra write it."""

    def written(machine: Machine, wishes: Wishes) -> Written:
        with needs_extra("cad"):
            write = getattr(import_module(f"agentflow.making.{module}"), name)
        content: Written = write(machine, wishes.making)
        return content

    return Format(written, "valid machine", options=options)


FORMATS: Mapping[str, Format] = {
    ".coords.json": Format(
        _document(lambda machine: lines_of(to_coordinates(machine)) + "\n"), of_the_game=True
    ),
    ".json": Format(_document(lambda machine: machine.to_text() + "\n")),
    ".bsg": Format(_bsg, of_the_game=True),
    ".glb": Format(_document(machine_glb)),
    ".urdf": Format(lambda machine, _: machine_urdf(machine), needs="valid machine"),
    ".xml": Format(_mjcf, needs="task", options=("--task",)),
    ".step": _made("step", "machine_step", "--scale"),
    ".stl": _made("printing", "machine_stl", "--scale", "--parts", "--pegs"),
    ".3mf": _made("printing", "machine_3mf", "--scale", "--parts", "--pegs"),
    ".usda": _made("usd", "machine_usd", "--scale"),
}
"""The first suffix that a file name ends with counts."""


def format_of(out: Path) -> Format:
    """The format of a file to write.

    Raises:
        UsageError: No format has its suffix.
    """
    for suffix, form in FORMATS.items():
        if out.name.lower().endswith(suffix):
            return form
    raise UsageError(f"cannot write {out}: use one of the suffixes {', '.join(FORMATS)}")


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
    write_file(out, data)
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
