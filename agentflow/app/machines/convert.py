"""Owns conversion: a machine file of one form to a file of another."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from agentflow.app.machines.files import machine_text
from agentflow.env.drawing.gltf import machine_glb
from agentflow.errors import UsageError
from agentflow.files import write_atomically
from agentflow.machine import Machine, Problem, library
from agentflow.machine.blocks.plates import plate_of
from agentflow.machine.formats.bsg_writing import to_bsg
from agentflow.machine.formats.connect import LocatedMachine
from agentflow.machine.formats.coordinates import to_coordinates
from agentflow.machine.formats.detect import read_any


def convert(source: str, out: Path, *, strict: bool = False) -> dict[str, Any]:
    """Read a machine in any form and write it in the form that the ending of `out` says.

    Blocks outside the library, scaled or turned off the grid, and those that hang on nothing are
    left out and named. All types of the library are taken over, extended ones too.

    Args:
        source: file, or `-` for standard input.
        out: file to write, `.json` (tree), `.coords.json`, `.bsg` or `.glb` (only to look at).
        strict: refuse a machine when a block must be left out or a parent is ambiguous.

    Raises:
        UsageError: The source is no machine, nothing but its Starting Block could be taken over,
            it is refused, or `out` cannot be written.
    """
    write = _writer(out)
    reading = read_any(machine_text(source), blocks=tuple(library()))
    problems = reading.problems
    if isinstance(reading, LocatedMachine):
        problems = tuple(sorted((*problems, *reading.loose), key=lambda problem: problem.blocks))
    machine = reading.machine
    if machine is None or (strict and problems):
        raise UsageError(f"{source} cannot be converted: {_told(problems)}")
    if len(machine) == 1 and problems:
        raise UsageError(
            f"{source} cannot be converted: nothing would be left of it but the Starting Block: "
            f"{_told(problems)}"
        )
    if write in OF_THE_GAME and plate_of(machine[0].type):
        raise UsageError(
            f"{source} cannot be converted: it is built on a plate, which is no block of the game; "
            f"the endings for it are .json and .glb"
        )
    data = write(machine)
    try:
        with write_atomically(out) as part:
            part.write_bytes(data)
    except OSError as error:
        raise UsageError(f"cannot write {out}: {error.strerror}") from None
    return {
        "out": str(out),
        "blocks": len(machine),
        "left_out": [problem.to_json() for problem in problems],
        "notes": list(reading.notes),
    }


def _told(problems: tuple[Problem, ...]) -> str:
    """The first problem, one that a number cannot be read before others, and how many there are."""
    problems = tuple(sorted(problems, key=lambda problem: problem.code != "not_a_number"))
    rest = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return problems[0].message + rest


def _coordinates(machine: Machine) -> bytes:
    lines = (f"  {json.dumps(item)}" for item in to_coordinates(machine))
    return ("[\n" + ",\n".join(lines) + "\n]\n").encode()


WRITERS: Mapping[str, Callable[[Machine], bytes]] = {
    ".coords.json": _coordinates,
    ".json": lambda machine: (machine.to_text() + "\n").encode(),
    ".bsg": lambda machine: to_bsg(machine).encode(),
    ".glb": machine_glb,
}
"""Ending of a file -> what it holds; the first that fits counts."""
OF_THE_GAME = (WRITERS[".coords.json"], WRITERS[".bsg"])
"""Those that begin with the Starting Block."""


def _writer(out: Path) -> Callable[[Machine], bytes]:
    for ending, write in WRITERS.items():
        if out.name.lower().endswith(ending):
            return write
    raise UsageError(f"cannot write {out}: the endings are {', '.join(WRITERS)}")
