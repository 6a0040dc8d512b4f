"""A control program while it is changed: makes single changes, or refuses them with a reason."""

from collections.abc import Collection, Mapping
from dataclasses import replace

from agentflow.machine.blocks.types import Group
from agentflow.machine.controllers.reading import to_precision
from agentflow.machine.controls import MAX_CONTROLS, entry_problems, target_text, window_problem
from agentflow.machine.edits.commands import AddControl, Quantity
from agentflow.machine.problems import RefusedEdit, comma_list
from agentflow.machine.tree import Control, Step, shorten

_FIELDS: Mapping[Quantity, str] = {"at": "at", "for": "lasts", "level": "level"}
"""Quantity -> field of `Control`."""


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
        """Add an entry; raise `RefusedEdit` if it is wrong.

        Args:
            target: The blocks or the group that the command names.
            command: The rest of the entry.
            steps: The machine as it is now.
            window: Latest end of a control, s; None: any.
        """
        once = target if isinstance(target, str) else tuple(dict.fromkeys(target))
        control = Control(once, *map(to_precision, (command.at, command.lasts, command.level)))
        if len(self._entries) >= MAX_CONTROLS:
            reason = f"a machine can have at most {MAX_CONTROLS} controls: Uncontrol others first"
            raise RefusedEdit("too_many_controls", reason)
        self._require_entry(self._next, control, steps, window)
        self._entries[self._next] = control
        self._next += 1

    def set(
        self,
        number: int,
        values: Mapping[Quantity, float],
        steps: Collection[Step],
        window: float | None,
    ) -> str:
        """Change numbers of an entry of the given machine; what has changed, in words.

        Raises `RefusedEdit` if that is wrong, or changes nothing.
        """
        self._require_given(number)
        old = self._entries[number]
        fields = {_FIELDS[name]: to_precision(value) for name, value in values.items()}
        new = replace(old, **fields)  # type: ignore[arg-type]
        self._require_entry(number, new, steps, window)
        before, after = old.to_json(), new.to_json()
        changed = [
            f"{name} {before[name]}{unit} -> {after[name]}{unit}"
            for name, unit in (("at", " s"), ("for", " s"), ("level", ""))
            if before[name] != after[name]
        ]
        if not changed:
            has = comma_list(f"{name} {before[name]}" for name in values)
            raise RefusedEdit("no_change", f"control {number} has {has} already: remove the line")
        self._entries[number] = new
        return f"control {number} ({target_text(old)}): {comma_list(changed)}"

    def remove(self, number: int) -> str:
        """Remove an entry of the given machine; what it was, in words.

        Raises `RefusedEdit` if it is not there.
        """
        self._require_given(number)
        gone = self._entries.pop(number)
        at, lasts, level = map(shorten, (gone.at, gone.lasts, gone.level))
        what = f"control {number} ({target_text(gone)})"
        return f"{what}, at {at} s for {lasts} s level {level}, is removed"

    def _require_entry(
        self, number: int, control: Control, steps: Collection[Step], window: float | None
    ) -> None:
        ends = window_problem(number, control, window)
        for problem in (*entry_problems(number, control, steps), *ends):
            raise RefusedEdit(problem.code, problem.message)

    def _require_given(self, number: int) -> None:
        """Refuse a number that is no entry of the given machine, or one not there any more."""
        if not 0 <= number < self._given:
            known = f"the controls are 0 to {self._given - 1}" if self._given else "it has none"
            raise RefusedEdit("control_not_found", f"the machine has no control {number}; {known}")
        if number not in self._entries:
            reason = f"control {number} was removed earlier in this script"
            raise RefusedEdit("control_not_found", reason)

    def naming(self, block: int) -> list[int]:
        """Numbers of the entries that name a block by its id."""
        return [
            number
            for number, control in self._entries.items()
            if isinstance(control.target, tuple) and block in control.target
        ]

    def forget(self, block: int) -> None:
        """Let no entry name a block that nothing drives any more; one that names no other goes
        with it."""
        for number in self.naming(block):
            control = self._entries[number]
            if isinstance(control.target, tuple):
                left = tuple(other for other in control.target if other != block)
                self._entries[number] = replace(control, target=left)
                if not left:
                    del self._entries[number]

    def require_groups(self, removed: int, steps: Collection[Step]) -> None:
        """Raise `RefusedEdit` if a group that an entry drives lost its last block just now."""
        for number, control in self._entries.items():
            if isinstance(control.target, str) and any(entry_problems(number, control, steps)):
                reason = (
                    f"control {number} drives {control.target}, and block {removed} is the last "
                    f"of them: first Uncontrol {number}"
                )
                raise RefusedEdit("control_group", reason)
