"""Reads the machines that runs have stored."""

from pathlib import Path

from agentflow.errors import DamagedError
from agentflow.machine import Machine, library, read_machine
from agentflow.runs.reading import MACHINES, read_machine_text


def recorded_machine(run: Path, digest: str) -> Machine:
    """A machine of a run by its content hash; raises RunError if it cannot be read."""
    machine = read_machine(read_machine_text(run, digest), library()).machine
    if machine is None or machine.digest != digest:
        file = run / MACHINES / f"{digest}.json"
        raise DamagedError(f"{file} is damaged: its machine does not match its name")
    return machine
