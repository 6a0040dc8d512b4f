"""Reads the machines saved in a run directory."""

from __future__ import annotations

from pathlib import Path

from agentflow.errors import RunError
from agentflow.machine import Brief, Machine, check, library, read_machine
from agentflow.machine.problems import LATER_RULES
from agentflow.runs.reading import MACHINES, read_machine_text


def recorded_machine(path: Path, digest: str) -> Machine:
    """Read a machine of a run by its content hash."""
    machine = read_machine(read_machine_text(path, digest), tuple(library())).machine
    if machine is None or machine.digest != digest:
        file = path / MACHINES / f"{digest}.json"
        raise RunError(f"{file} is damaged: its machine does not match its name")
    return machine


def later_note(machine: Machine, brief: Brief) -> str:
    """Why a recorded machine would now be refused, by rules that came after its run; or ""."""
    found = [item for item in check(machine, brief).problems if item.code in LATER_RULES]
    if not found:
        return ""
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"would now be refused: {found[0].message}{more}"
