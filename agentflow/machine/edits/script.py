"""Edit scripts: apply a list of commands to a machine, all or nothing."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from typing import Literal

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.edits.commands import (
    GRAMMAR,
    Add,
    Command,
    Move,
    Remove,
    read_command,
    script_lines,
)
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.problems import block_label, comma_list, face_problem, type_problem
from agentflow.machine.space import ANYWHERE, spatial_problems
from agentflow.machine.tree import Machine, Step, renumber
from agentflow.machine.validity import budget_problems

_BAD_FORMAT = "not a command; the commands are: " + "; ".join(GRAMMAR)
_EMPTY = "the script has no commands; the commands are: " + "; ".join(GRAMMAR)


@dataclass(frozen=True)
class StepVerdict:
    """The outcome of one line of a script."""

    text: str
    """The line as written."""
    verdict: Literal["Success", "Error", "Unverified"]
    code: str = ""
    """Kind of error; "" if there is none."""
    reason: str = ""
    """One sentence that a model can act on; "" if there is no error."""

    def to_json(self) -> dict[str, str]:
        """The verdict as JSON data."""
        return asdict(self)


@dataclass(frozen=True)
class EditOutcome:
    """The outcome of a script."""

    success: bool
    steps: tuple[StepVerdict, ...]
    machine: Machine
    """The edited machine; the given one if the script failed."""
    id_map: dict[int, int | None]
    """Id in the given machine -> id in `machine`; None for removed blocks."""

    def to_json(self) -> dict[str, object]:
        """The outcome as JSON data."""
        return {
            "outcome": "success" if self.success else "failure",
            "steps": [step.to_json() for step in self.steps],
            "machine": self.machine.to_json(),
            "id_map": {str(old): new for old, new in self.id_map.items()},
        }


def apply_script(machine: Machine, script: str, brief: Brief | None = None) -> EditOutcome:
    """Apply an edit script to a file-valid machine. Never raises.

    The first command that fails stops the script and leaves the machine unchanged. The whole
    machine is checked after every command. On success, blocks keep their order, additions come
    last, and ids are renumbered 0, 1, 2, ...

    Args:
        machine: machine to edit.
        script: one command per line; ids are those of `machine` throughout.
        brief: the task, for its block list and limits; the core types and the standard
            building volume if None.
    """
    same: dict[int, int | None] = {step.id: step.id for step in machine}
    lines = script_lines(script)
    if not lines:
        return EditOutcome(False, (StepVerdict("", "Error", "bad_format", _EMPTY),), machine, same)
    draft = _Draft(machine, brief)
    verdicts: list[StepVerdict] = []
    for line in lines:
        try:
            draft.apply(read_command(line))
        except _Refused as refused:
            verdicts.append(StepVerdict(line, "Error", refused.code, refused.reason))
            verdicts += [StepVerdict(rest, "Unverified") for rest in lines[len(verdicts) :]]
            return EditOutcome(False, tuple(verdicts), machine, same)
        verdicts.append(StepVerdict(line, "Success"))
    edited, id_map = draft.finish()
    return EditOutcome(True, tuple(verdicts), edited, id_map)


class _Refused(Exception):
    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


class _Draft:
    """A machine being edited: ids may have gaps, and additions get new ids at the end."""

    def __init__(self, machine: Machine, brief: Brief | None) -> None:
        self.original = len(machine)
        self.steps = {step.id: step for step in machine}
        self.next_id = self.original
        self.brief = brief
        self.given = 1 if brief is None else len(brief.given)
        self.allowed: Collection[int] = library().core if brief is None else brief.blocks
        self.limits = ANYWHERE if brief is None else brief.limits

    def apply(self, command: Command | None) -> None:
        """Apply one command; raise `_Refused` if that is impossible."""
        if isinstance(command, Add):
            self._add(command)
        elif isinstance(command, Remove):
            self._remove(command)
        elif isinstance(command, Move):
            self._move(command)
        else:
            raise _Refused("bad_format", _BAD_FORMAT)

    def finish(self) -> tuple[Machine, dict[int, int | None]]:
        """The renumbered machine, and the map from original to new ids."""
        edited, new_ids = renumber(self.steps.values())
        return edited, {old: new_ids.get(old) for old in range(self.original)}

    def _add(self, command: Add) -> None:
        two_ended = len(command.ends) == 2
        fault = type_problem(command.type, self.allowed, two_ended=two_ended)
        if fault is not None:
            raise _Refused(*fault)
        for parent, face in command.ends:
            self._require_face(parent, face)
        if not two_ended:
            self._require_free(*command.ends[0])
        self._require_budget(len(self.steps) + 1)
        added = Step(self.next_id, command.type, *(part for end in command.ends for part in end))
        self.next_id += 1
        self._put(added, f"with {library()[command.type].name} as new block {added.id}: ")

    def _remove(self, command: Remove) -> None:
        removed = self._require_editable(command.id, "removed")
        carried = [step.id for step in self.steps.values() if removed.id in step.parents]
        if carried:
            what = f"{block_label(removed.id, removed.type)} still carries {comma_list(carried)}"
            raise _Refused("has_children", f"{what}; remove the blocks it carries first")
        del self.steps[removed.id]
        self._require_space("")

    def _move(self, command: Move) -> None:
        moved = self._require_editable(command.id, "moved")
        if moved.two_ended:
            what = f"{block_label(moved.id, moved.type)} is two-ended and cannot be moved"
            raise _Refused("two_ended", f"{what}; remove it and add a new one")
        self._require_parent(command.parent)
        if command.parent >= moved.id:
            reason = f"new parent {command.parent} does not come before block {moved.id}"
            raise _Refused("parent_not_earlier", f"{reason}; a parent must have a smaller id")
        self._require_face(command.parent, command.face)
        if (command.parent, command.face) == (moved.parent, moved.face_id):
            reason = f"block {moved.id} is already on face {command.face} of block {command.parent}"
            raise _Refused("no_change", reason)
        self._require_free(command.parent, command.face)
        self._put(replace(moved, parent=command.parent, face_id=command.face), "")

    def _put(self, step: Step, prefix: str) -> None:
        self.steps[step.id] = step
        self._require_space(prefix)

    def _require_editable(self, block_id: int, done: str) -> Step:
        if block_id == 0:
            raise _Refused("starting_block", f"block 0, the Starting Block, cannot be {done}")
        if not 0 <= block_id < self.original:
            raise _Refused("block_not_found", self._absent(block_id, done))
        if block_id < self.given:
            raise _Refused("given_altered", f"block {block_id} is given and cannot be {done}")
        if block_id not in self.steps:
            raise _Refused("block_removed", f"block {block_id} was removed earlier in this script")
        return self.steps[block_id]

    def _require_parent(self, parent: int) -> Step:
        if not 0 <= parent < self.original:
            raise _Refused("parent_not_found", self._absent(parent, "used as a parent"))
        if parent not in self.steps:
            raise _Refused("parent_removed", f"block {parent} was removed earlier in this script")
        return self.steps[parent]

    def _require_face(self, parent: int, face: int) -> None:
        fault = face_problem(parent, self._require_parent(parent).type, face)
        if fault is not None:
            raise _Refused("face_not_found", fault)

    def _require_free(self, parent: int, face: int) -> None:
        for step in self.steps.values():
            if (step.parent, step.face_id) == (parent, face) and not step.two_ended:
                carrier = block_label(parent, self.steps[parent].type)
                reason = (
                    f"face {face} of {carrier} is already taken by "
                    f"{block_label(step.id, step.type)}; free faces of block {parent}: "
                    f"{comma_list(self._geometry().free_faces(parent))}"
                )
                raise _Refused("face_occupied", reason)

    def _require_budget(self, total: int) -> None:
        """Refuse a machine of `total` blocks if they are too many."""
        if total > MAX_BLOCKS:
            raise _Refused("too_many_blocks", f"a machine can have at most {MAX_BLOCKS} blocks")
        for problem in budget_problems(total, self.brief) if self.brief else ():
            raise _Refused(problem.code, f"with this block {problem.message} in an earlier line")

    def _require_space(self, prefix: str) -> None:
        """Refuse if the current machine is spatially invalid."""
        for problem in spatial_problems(self._geometry(), self.limits)[:1]:
            raise _Refused(problem.code, prefix + problem.message)

    def _geometry(self) -> Geometry:
        return place(self.steps.values())

    def _absent(self, block_id: int, use: str) -> str:
        if self.original <= block_id < self.next_id:
            added = f"block {block_id} is added by this script"
            return f"{added}; it cannot be {use} in the same script"
        return f"block {block_id} does not exist; the blocks are 0 to {self.original - 1}"
