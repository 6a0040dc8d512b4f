"""The file formats that machines are written in, by suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal

from agentflow.env.drawing.gltf import machine_glb
from agentflow.env.export.urdf import machine_urdf
from agentflow.env.physics.registry import ENGINES
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.extras import needs_extra
from agentflow.machine import Machine
from agentflow.machine.formats.bsg_keys import bind_keys
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.machine.formats.coordinates import to_coordinates
from agentflow.machine.tree import lines_of
from agentflow.making.sizes import USUAL, Making

Written = tuple[bytes, tuple[str, ...]]
"""Content of a file, and what it cannot hold, one sentence each."""


@dataclass(frozen=True)
class Wishes:
    """What a file is to hold besides the machine, and how the machine is to be made."""

    task: Task | None = None
    making: Making = USUAL


@dataclass(frozen=True)
class Format:
    """A file format."""

    write: Callable[[Machine, Wishes], Written]
    needs: Literal["blocks", "valid machine", "task"] = "blocks"
    """`blocks`: it holds any file-valid machine; `task`: it holds the scene of a task as well, and
    the machine must be valid on it."""
    of_the_game: bool = False
    """Whether its machines begin with the Starting Block."""
    options: tuple[str, ...] = ()
    """Options that change what it holds."""


def _document(write: Callable[[Machine], bytes | str]) -> Callable[[Machine, Wishes], Written]:
    """A writer of files that hold everything."""

    def written(machine: Machine, _: Wishes) -> Written:
        content = write(machine)
        return content.encode() if isinstance(content, str) else content, ()

    return written


def _coordinates(machine: Machine) -> str:
    return lines_of(to_coordinates(machine)) + "\n"


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
    ".coords.json": Format(_document(_coordinates), of_the_game=True),
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
