"""A machine while a script edits it: applies commands, or refuses them with a reason."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import Group
from agentflow.machine.brief import Brief
from agentflow.machine.controls import GROUPS
from agentflow.machine.edits.commands import (
    CONTROL_GRAMMAR,
    GRAMMAR,
    NAMING,
    Add,
    AddControl,
    Command,
    Move,
    Ref,
    Remove,
    RemoveControl,
)
from agentflow.machine.edits.names import Names, Refused
from agentflow.machine.edits.program import NO_CONTROLS, Program
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.problems import block_label, comma_list, face_problem, type_problem
from agentflow.machine.space import ANYWHERE, spatial_problems
from agentflow.machine.tree import Machine, Step, renumber
from agentflow.machine.validity import budget_problems


def _bad_format(*more: str) -> Refused:
    """The refusal of a line that is no command; `more` are the commands besides those for all."""
    commands = "; ".join((*GRAMMAR, *more))
    return Refused("bad_format", f"not a command; the commands are: {commands}; {NAMING}")


class Draft:
    """A machine being edited: ids may have gaps, and additions get new ids at the end."""

    def __init__(
        self, machine: Machine, brief: Brief | None, commands: Sequence[Command | None]
    ) -> None:
        """Begin with a machine; `commands` are those of the whole script, for messages."""
        self._original = len(machine)
        self._steps = {step.id: step for step in machine}
        """In building order: parents come first."""
        self._program = Program(machine.controls)
        self._names = Names(commands)
        self._next_id = self._original
        self._brief = brief
        self._given = 1 if brief is None else len(brief.given)
        self._allowed: Collection[int] = library().core if brief is None else brief.blocks
        self._limits = ANYWHERE if brief is None else brief.limits

    def apply(self, command: Command | None) -> None:
        """Apply one command; raise `Refused` if that is impossible."""
        if isinstance(command, Add):
            self._add(command)
        elif isinstance(command, Remove):
            self._remove(command)
        elif isinstance(command, Move):
            self._move(command)
        elif command is not None and self._controlled:
            self._control(command)
        elif isinstance(command, AddControl | RemoveControl):
            raise Refused("controls_not_allowed", NO_CONTROLS)
        else:
            raise _bad_format(*(CONTROL_GRAMMAR if self._brief and self._controlled else ()))

    def finish(self) -> tuple[Machine, dict[int, int | None], dict[str, int | None]]:
        """The renumbered machine, and the maps from original ids and from names to its ids."""
        edited, new_ids = renumber(self._steps.values(), self._program.controls)
        id_map = {old: new_ids.get(old) for old in range(self._original)}
        return edited, id_map, {name: new_ids.get(id_) for name, id_ in self._names.given.items()}

    def _add(self, command: Add) -> None:
        two_ended = len(command.ends) == 2
        fault = type_problem(command.type, self._allowed, two_ended=two_ended)
        if fault is not None:
            raise Refused(*fault)
        ends = [(self._parent(ref), face) for ref, face in command.ends]
        for parent, face in ends:
            self._require_face(parent, face)
        if not two_ended:
            self._require_free(*ends[0])
        self._require_budget(len(self._steps) + 1)
        added = Step(self._next_id, command.type, *(part for end in ends for part in end))
        self._next_id += 1
        if command.name:
            self._names.give(command.name, added.id)
        self._steps[added.id] = added
        label = f"{added.id} ({command.name})" if command.name else added.id
        self._require_space(f"with {library()[command.type].name} as new block {label}: ")

    def _remove(self, command: Remove) -> None:
        removed = self._editable(command.block, "removed")
        carried = [step.id for step in self._steps.values() if removed.id in step.parents]
        if carried:
            what = f"{block_label(removed.id, removed.type)} still carries {comma_list(carried)}"
            raise Refused("has_children", f"{what}; remove the blocks it carries first")
        del self._steps[removed.id]
        self._program.forget(removed.id, self._steps.values())
        self._require_space("")

    def _move(self, command: Move) -> None:
        moved = self._editable(command.block, "moved")
        if moved.two_ended:
            what = f"{block_label(moved.id, moved.type)} is two-ended and cannot be moved"
            raise Refused("two_ended", f"{what}; remove it and add a new one")
        parent, face = self._parent(command.parent), command.face
        carried = self._carried_by(moved)
        self._require_order(moved.id, parent, carried)
        self._require_face(parent, face)
        if (parent, face) == (moved.parent, moved.face_id):
            reason = f"block {moved.id} is already on face {face} of block {parent}"
            raise Refused("no_change", reason)
        self._require_free(parent, face)
        self._steps[moved.id] = replace(moved, parent=parent, face_id=face)
        order = list(self._steps)
        if order.index(parent) > order.index(moved.id):
            for id_ in carried:  # to the end, so that parents come first
                self._steps[id_] = self._steps.pop(id_)
        self._require_space("")

    @property
    def _controlled(self) -> bool:
        """Whether the machine may have controls: without a task it may."""
        return self._brief is None or self._limits.controls is not None

    def _control(self, command: AddControl | RemoveControl) -> None:
        if isinstance(command, RemoveControl):
            self._program.remove(command.number)
            return
        group = self._group_of(command.target)
        target = group or tuple(self._find(ref, "block", "controlled") for ref in command.target)
        self._program.add(target, command, self._steps.values(), self._limits.controls)

    def _group_of(self, target: Sequence[Ref]) -> Group | None:
        """The group that words name; None if they name blocks."""
        words = "_".join(map(str, target))
        named = len(target) == 1 and target[0] in self._names.given
        return next((group for group in GROUPS if group == words and not named), None)

    def _carried_by(self, block: Step) -> list[int]:
        """Ids of a block and of everything attached to it, in building order."""
        carried = [block.id]
        for step in self._steps.values():
            if not set(carried).isdisjoint(step.parents):
                carried.append(step.id)
        return carried

    def _editable(self, ref: Ref, done: str) -> Step:
        """A block that may be removed or moved."""
        block_id = self._find(ref, "block", done)
        if block_id == 0:
            raise Refused("starting_block", f"block 0, the Starting Block, cannot be {done}")
        if block_id < self._given:
            raise Refused("given_altered", f"block {block_id} is given and cannot be {done}")
        return self._steps[block_id]

    def _parent(self, ref: Ref) -> int:
        return self._find(ref, "parent", "used as a parent")

    def _find(self, ref: Ref, what: str, use: str) -> int:
        """The id of a block that is still there; `what` begins the codes of refusals."""
        block_id = self._names.find(ref) if isinstance(ref, str) else ref
        if isinstance(ref, int) and not 0 <= ref < self._original:
            raise Refused(f"{what}_not_found", self._absent(ref, use))
        if block_id not in self._steps:
            label = ref if isinstance(ref, str) else f"block {ref}"
            raise Refused(f"{what}_removed", f"{label} was removed earlier in this script")
        return block_id

    def _absent(self, block_id: int, use: str) -> str:
        if self._original <= block_id < self._next_id:
            name = self._names.name_of(block_id)
            how = f"use its name, {name}" if name else "name it, as in 'Add 15 to 0 in 4 as a'"
            return f"block {block_id} is added by this script; it can be {use} by name only: {how}"
        return f"block {block_id} does not exist; the blocks are 0 to {self._original - 1}"

    def _require_order(self, moved: int, parent: int, carried: Sequence[int]) -> None:
        """Refuse a later block of the machine, and one that the moved block carries, as parent."""
        if moved <= parent < self._original:
            reason = f"new parent {parent} does not come before block {moved}"
            rule = "a parent must have a smaller id or be added by this script"
            raise Refused("parent_not_earlier", f"{reason}; {rule}")
        if parent in carried:
            reason = f"block {moved} carries block {parent}; choose a parent that it does not carry"
            raise Refused("parent_not_earlier", reason)

    def _require_face(self, parent: int, face: int) -> None:
        fault = face_problem(parent, self._steps[parent].type, face)
        if fault is not None:
            raise Refused("face_not_found", fault)

    def _require_free(self, parent: int, face: int) -> None:
        for step in self._steps.values():
            if (step.parent, step.face_id) == (parent, face) and not step.two_ended:
                carrier = block_label(parent, self._steps[parent].type)
                reason = (
                    f"face {face} of {carrier} is already taken by "
                    f"{block_label(step.id, step.type)}; free faces of block {parent}: "
                    f"{comma_list(self._geometry().free_faces(parent))}"
                )
                raise Refused("face_occupied", reason)

    def _require_budget(self, total: int) -> None:
        """Refuse a machine of `total` blocks if they are too many."""
        if total > MAX_BLOCKS:
            raise Refused("too_many_blocks", f"a machine can have at most {MAX_BLOCKS} blocks")
        for problem in budget_problems(total, self._brief) if self._brief else ():
            raise Refused(problem.code, f"with this block {problem.message} in an earlier line")

    def _require_space(self, prefix: str) -> None:
        """Refuse if the current machine is spatially invalid."""
        for problem in spatial_problems(self._geometry(), self._limits)[:1]:
            raise Refused(problem.code, prefix + problem.message)

    def _geometry(self) -> Geometry:
        return place(self._steps.values())
