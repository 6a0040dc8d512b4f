"""Parts lists and instructions of machines, and the files that one makes them from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agentflow.app.machines.convert import FORMATS, Wishes
from agentflow.app.machines.files import read_one
from agentflow.errors import UsageError
from agentflow.files.atomic import write_output
from agentflow.machine import Machine, Problem, place, spatial_problems
from agentflow.machine.build_order import build_order
from agentflow.machine.space import ANY_SIZE
from agentflow.making.guide import COLUMNS, bill, bill_csv, guide, steps_of
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
        text = bill_csv(machine) if suffix == ".csv" else _markdown(rows)
        with write_output(out) as part:
            part.write_bytes(text.encode())
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
    with write_output(out) as part:
        part.write_text(page, encoding="utf-8")
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
