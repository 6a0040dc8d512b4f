"""The control program of a machine while a script edits it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from agentflow.machine.blocks.types import Group
from agentflow.machine.controls import (
    MAX_CONTROLS,
    entry_problems,
    window_problem,
)
from agentflow.machine.edits.commands import AddControl
from agentflow.machine.edits.names import Refused
from agentflow.machine.formats.control_json import to_precision
from agentflow.machine.tree import Control, Step

NO_CONTROLS = "this task switches all blocks by its own schedule; remove the line"


class Program:
    """Entries by their number in the given machine; new ones get the numbers that follow."""

    def __init__(self, controls: tuple[Control, ...]) -> None:
        self._entries = dict(enumerate(controls))
        self._given = self._next = len(controls)

    @property
    def controls(self) -> tuple[Control, ...]:
        """The entries in order."""
        return tuple(self._entries.values())

    def add(
        self,
        target: tuple[int, ...] | Group,
        command: AddControl,
        steps: Collection[Step],
        window: float | None,
    ) -> None:
        """Add an entry; raise `Refused` if it is wrong.

        Args:
            target: The blocks or the group that the command names.
            command: The rest of the entry.
            steps: The machine as it is now.
            window: Latest end of a control, s; None: any.
        """
        target = target if isinstance(target, str) else tuple(dict.fromkeys(target))
        numbers = map(to_precision, (command.at, command.lasts, command.level))
        control = Control(target, *numbers)
        if len(self._entries) >= MAX_CONTROLS:
            reason = f"a machine can have at most {MAX_CONTROLS} controls: Uncontrol others first"
            raise Refused("too_many_controls", reason)
        problems = list(entry_problems(self._next, control, steps))
        problems += window_problem(self._next, control, window)
        for problem in problems[:1]:
            raise Refused(problem.code, problem.message)
        self._entries[self._next] = control
        self._next += 1

    def remove(self, number: int) -> None:
        """Remove an entry of the given machine; raise `Refused` if it is not there."""
        if not 0 <= number < self._given:
            known = f"the controls are 0 to {self._given - 1}" if self._given else "it has none"
            raise Refused("control_not_found", f"the machine has no control {number}; {known}")
        if number not in self._entries:
            reason = f"control {number} was removed earlier in this script"
            raise Refused("control_not_found", reason)
        del self._entries[number]

    def forget(self, block: int, steps: Collection[Step]) -> None:
        """Let no entry name a removed block; raise `Refused` if a group has no block now."""
        for number, control in list(self._entries.items()):
            if isinstance(control.target, str):
                if any(entry_problems(number, control, steps)):
                    reason = (
                        f"control {number} drives {control.target}, of which block {block} is the "
                        f"last: first Uncontrol {number}"
                    )
                    raise Refused("control_group", reason)
            elif block in control.target:
                left = tuple(other for other in control.target if other != block)
                self._entries[number] = replace(control, target=left)
                if not left:
                    del self._entries[number]
