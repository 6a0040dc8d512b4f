"""The machines of a run by name: the first 8 hex digits of their content hash."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from agentflow.machine.brief import Brief
from agentflow.machine.tree import Machine
from agentflow.machine.validity import Report, check
from agentflow.runs.places import StageName
from agentflow.tools.results import Refused

DIGITS = 8
"""Length of a name."""
MOST_MACHINES = 2000
"""Most machines of a run."""


@dataclass
class KnownMachine:
    """A machine that an agent can name."""

    name: str
    machine: Machine
    parent: str = ""
    """Name of the machine that it was edited from; "" for one that was written as a whole."""
    script: str = ""
    """The commands of that edit."""
    submitted: StageName | None = None
    """The first stage in which it was submitted."""


class KnownMachines:
    """All machines of a run that an agent can name, oldest first; stages share them."""

    def __init__(self, most: int = MOST_MACHINES) -> None:
        """Keep at most so many machines."""
        self._most = most
        self._machines: dict[str, KnownMachine] = {}

    def __iter__(self) -> Iterator[KnownMachine]:
        return iter(self._machines.values())

    def __len__(self) -> int:
        return len(self._machines)

    def add(self, machine: Machine, parent: str = "", script: str = "") -> KnownMachine:
        """Give a machine a name; a known one keeps what is known about it."""
        name = machine.digest[:DIGITS]
        if name in self._machines and self._machines[name].machine != machine:
            name = machine.digest
        if name not in self._machines:
            if len(self) >= self._most:
                raise Refused(f"a run keeps at most {self._most} machines; go on with these")
            self._machines[name] = KnownMachine(name, machine, parent, script)
        return self._machines[name]

    def find(self, name: str) -> KnownMachine:
        """The machine of this name, or refuse with the names there are."""
        wanted = name.strip().lower()
        for known in self:
            if wanted in (known.name, known.machine.digest):
                return known
        newest = [known.name for known in self][:-6:-1]
        raise Refused(
            f"there is no machine {name.strip()[:40]!r}; "
            + (f"the newest are {', '.join(newest)}" if newest else "there is none yet")
            + "; `check` and `edit` name machines, `history` lists them"
        )


def complete_report(machine: Machine, brief: Brief) -> Report:
    """The validity of a machine, or refuse one that cannot be simulated as it is."""
    report = check(machine, brief)
    if not report.task_valid:
        problem = report.problems[0]
        raise Refused(f"this machine is not complete: {problem.message}; `edit` it", problem.code)
    return report
