"""A machine while it is changed: makes single changes, or refuses them with a reason."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import Group
from agentflow.machine.brief import Brief
from agentflow.machine.controls import (
    MAX_CONTROLS,
    entry_problems,
    window_problem,
)
from agentflow.machine.edits.commands import AddControl
from agentflow.machine.formats.control_json import to_precision
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.problems import (
    Problem,
    RefusedEdit,
    block_label,
    comma_list,
    face_problem,
    type_problem,
)
from agentflow.machine.space import ANYWHERE, spatial_problems
from agentflow.machine.tree import Control, Machine, Step, carried_by, renumber
from agentflow.machine.validity import budget_problems

NO_CONTROLS = "this task switches all blocks by its own schedule; remove the line"
End = tuple[int, int]
"""A block and one of its faces."""


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
        target = target if isinstance(target, str) else tuple(dict.fromkeys(target))
        numbers = map(to_precision, (command.at, command.lasts, command.level))
        control = Control(target, *numbers)
        if len(self._entries) >= MAX_CONTROLS:
            reason = f"a machine can have at most {MAX_CONTROLS} controls: Uncontrol others first"
            raise RefusedEdit("too_many_controls", reason)
        problems = list(entry_problems(self._next, control, steps))
        problems += window_problem(self._next, control, window)
        for problem in problems[:1]:
            raise RefusedEdit(problem.code, problem.message)
        self._entries[self._next] = control
        self._next += 1

    def remove(self, number: int) -> None:
        """Remove an entry of the given machine; raise `RefusedEdit` if it is not there."""
        if not 0 <= number < self._given:
            known = f"the controls are 0 to {self._given - 1}" if self._given else "it has none"
            raise RefusedEdit("control_not_found", f"the machine has no control {number}; {known}")
        if number not in self._entries:
            reason = f"control {number} was removed earlier in this script"
            raise RefusedEdit("control_not_found", reason)
        del self._entries[number]

    def forget(self, block: int) -> None:
        """Let no entry name a removed block; one that names no other goes with it."""
        for number, control in list(self._entries.items()):
            if isinstance(control.target, tuple) and block in control.target:
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


class Draft:
    """A machine being changed: ids may have gaps, and new blocks get new ids at the end.

    A change raises `RefusedEdit` for what it names: types, faces, blocks that stay. What is wrong
    with the whole machine, such as overlaps, is in `problems`: whoever changes it decides when to
    look.
    """

    def __init__(self, machine: Machine, brief: Brief | None = None) -> None:
        """Begin with a machine; without a task, the core types and the standard volume hold."""
        self.original = len(machine)
        self.steps = {step.id: step for step in machine}
        """In building order: parents come first."""
        self.program = Program(machine.controls)
        self.next_id = self.original
        self.brief = brief
        self.limits = ANYWHERE if brief is None else brief.limits
        self._given = 1 if brief is None else len(brief.given)
        self._allowed: Collection[int] = library().core if brief is None else brief.blocks

    def attach(self, kind: int, ends: Sequence[End]) -> Step:
        """Add a block on one face, or between two."""
        two_ended = len(ends) == 2
        fault = type_problem(kind, self._allowed, two_ended=two_ended)
        if fault is not None:
            raise RefusedEdit(*fault)
        for end in ends:
            self._require_face(end)
        if not two_ended:
            self._require_free(ends[0])
        if len(self.steps) >= MAX_BLOCKS:
            raise RefusedEdit("too_many_blocks", f"a machine can have at most {MAX_BLOCKS} blocks")
        added = Step(self.next_id, kind, *(part for end in ends for part in end))
        self.next_id += 1
        self.steps[added.id] = added
        return added

    def detach(self, block: int) -> None:
        """Remove a block that carries nothing; controls no longer name it."""
        removed = self.editable(block, "removed")
        carried = [step.id for step in self.steps.values() if block in step.parents]
        if carried:
            what = f"{block_label(block, removed.type)} still carries {comma_list(carried)}"
            raise RefusedEdit("has_children", f"{what}; remove the blocks it carries first")
        del self.steps[block]
        self.program.forget(block)

    def reattach(self, block: int, to: End) -> None:
        """Attach a block, with everything attached to it, to another face."""
        moved = self.movable(block)
        parent, face = to
        carried = carried_by(self.steps.values(), block)
        if parent in carried:
            reason = f"block {block} carries block {parent}; choose a parent that it does not carry"
            raise RefusedEdit("parent_not_earlier", reason)
        self._require_face(to)
        if to == (moved.parent, moved.face_id):
            reason = f"block {block} is already on face {face} of block {parent}"
            raise RefusedEdit("no_change", reason)
        self._require_free(to)
        self.steps[block] = replace(moved, parent=parent, face_id=face)
        order = list(self.steps)
        if order.index(parent) > order.index(block):
            for id_ in carried:  # to the end, so that parents come first
                self.steps[id_] = self.steps.pop(id_)

    def editable(self, block: int, done: str) -> Step:
        """A block that can be `done` (removed or moved); refuses those that stay."""
        if block == 0:
            raise RefusedEdit("starting_block", f"block 0, the Starting Block, cannot be {done}")
        if block < self._given:
            raise RefusedEdit("given_altered", f"block {block} is given and cannot be {done}")
        return self.steps[block]

    def movable(self, block: int) -> Step:
        """A block that can be attached elsewhere; refuses others."""
        moved = self.editable(block, "moved")
        if moved.two_ended:
            what = f"{block_label(block, moved.type)} is two-ended and cannot be moved"
            raise RefusedEdit("two_ended", f"{what}; remove it and add a new one")
        return moved

    @property
    def geometry(self) -> Geometry:
        """Where the blocks are now."""
        return place(self.steps.values())

    @property
    def crowding(self) -> list[Problem]:
        """The problem of more blocks than the task allows, if so."""
        return budget_problems(len(self.steps), self.brief) if self.brief else []

    @property
    def problems(self) -> list[Problem]:
        """What makes the machine invalid as it is now, except the number of its blocks."""
        return spatial_problems(self.geometry, self.limits)

    def finish(self) -> tuple[Machine, dict[int, int]]:
        """The renumbered machine, and the map from ids to its ids."""
        return renumber(self.steps.values(), self.program.controls)

    def _require_face(self, end: End) -> None:
        parent, face = end
        fault = face_problem(parent, self.steps[parent].type, face)
        if fault is not None:
            raise RefusedEdit("face_not_found", fault)

    def _require_free(self, end: End) -> None:
        parent, face = end
        for step in self.steps.values():
            if (step.parent, step.face_id) == end and not step.two_ended:
                carrier = block_label(parent, self.steps[parent].type)
                reason = (
                    f"face {face} of {carrier} is already taken by "
                    f"{block_label(step.id, step.type)}; free faces of block {parent}: "
                    f"{comma_list(self.geometry.free_faces(parent))}"
                )
                raise RefusedEdit("face_occupied", reason)
