"""Reads the machines saved in a run directory."""

from __future__ import annotations

from pathlib import Path

from agentflow.errors import RunError
from agentflow.machine import Machine, library, read_machine


def recorded_machine(path: Path, digest: str) -> Machine:
    """Read a machine of a run by its content hash."""
    file = path / "machines" / f"{digest}.json"
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise RunError(f"{path} is damaged: it has no readable machines/{digest}.json") from None
    machine = read_machine(text, tuple(library())).machine
    if machine is None or machine.digest != digest:
        raise RunError(f"{file} is damaged: its machine does not match its name")
    return machine
