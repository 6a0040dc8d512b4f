"""Which changes are legal, and why not: the rules of validity, told before a change is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, Problem, library, place, spatial_problems
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.problems import face_problem, type_problem
from agentflow.machine.tree import Step, renumber
from agentflow.machine.validity import budget_problems
from agentflow.studio.building.changes import Change, End, add, copy, move, turns


@dataclass(frozen=True)
class Spot:
    """A face where a block might go."""

    block: int
    face: int
    position: Vec3
    """Machine frame, m."""
    facing: str
    why_not: str
    """What forbids it; "" if it is legal."""


@dataclass(frozen=True)
class Rules:
    """The rules for changing one machine at a task.

    A change is legal if it brings no problem that the machine does not have already: a machine with
    problems, such as an imported one, can be mended step by step.
    """

    machine: Machine
    brief: Brief

    def why_not(self, change: Change) -> str:
        """What forbids a change; "" if it is legal."""
        steps = {step.id: step for step in change.steps}
        faults = self._changed_given(steps) or self._faults(change.steps)
        if faults:
            return faults
        for problem in self._problems(change.steps):
            if (problem.code, problem.blocks) not in self._known:
                return problem.message.partition("; free faces of")[0]
        return ""

    def make(self, change: Change) -> tuple[Machine, int]:
        """The changed machine, and the block to go on with.

        Raises:
            UsageError: The change is not legal.
        """
        if reason := self.why_not(change):
            raise UsageError(reason)
        machine, ids = renumber(change.steps, self.machine.controls)
        return machine, ids.get(change.chosen, 0)

    def turned(self, block: int) -> Change:
        """The first legal change that turns a block.

        Raises:
            UsageError: There is none.
        """
        reasons = []
        for change in turns(self.machine, block):
            reason = self.why_not(change)
            if not reason:
                return change
            reasons.append(reason)
        raise UsageError(reasons[0] if reasons else "its parent has no other free face to turn to")

    def spots_to_add(self, kind: int, first: End | None = None) -> Iterator[Spot]:
        """Where a new block can go; `first` is the first end of a two-ended one."""
        linear = kind in library() and library()[kind].linear
        fault = type_problem(kind, self.brief.blocks, two_ended=linear)
        if fault:
            raise UsageError(fault[1])
        if not linear:
            yield from self._spots(lambda end: add(self.machine, kind, (end,)))
        elif first is None:
            yield from self._spots(None)
        else:
            yield from self._spots(lambda end: add(self.machine, kind, (first, end)), first)

    def spots_to_move(self, block: int) -> Iterator[Spot]:
        """Where a block can be moved to."""
        yield from self._spots(lambda end: move(self.machine, block, end))

    def spots_to_copy(self, block: int) -> Iterator[Spot]:
        """Where a copy of a block can go."""
        yield from self._spots(lambda end: copy(self.machine, block, end))

    def _spots(
        self, change: Callable[[End], Change] | None, first: End | None = None
    ) -> Iterator[Spot]:
        """Every face that is free, or every face at all for two-ended blocks."""
        geometry = place(self.machine)
        shared = change is None or first is not None
        for placed in geometry.blocks:
            faces = library()[placed.type].open_faces
            for face in faces if shared else geometry.free_faces(placed.id):
                if (placed.id, face) == first:
                    continue
                where = placed.faces[face]
                why = "" if change is None else self._why_not_at(change, (placed.id, face))
                yield Spot(placed.id, face, where.position, where.facing, why)

    def _why_not_at(self, change: Callable[[End], Change], end: End) -> str:
        try:
            return self.why_not(change(end))
        except UsageError as error:
            return str(error)

    @cached_property
    def _known(self) -> set[tuple[str, tuple[int, ...]]]:
        """The problems that the machine has already."""
        found = self._problems(self.machine.steps)
        return {(problem.code, problem.blocks) for problem in found}

    def _problems(self, steps: Sequence[Step]) -> list[Problem]:
        spatial = spatial_problems(place(steps), self.brief.limits)
        return spatial + budget_problems(len(steps), self.brief)

    def _changed_given(self, steps: dict[int, Step]) -> str:
        for given in self.brief.given:
            if steps.get(given.id) != given:
                what = "the root" if given.id == 0 else f"block {given.id}"
                return f"{what} is given by the task, so it stays as it is"
        return ""

    def _faults(self, steps: Sequence[Step]) -> str:
        """Why the new or moved blocks cannot be what or where they are."""
        if len(steps) > MAX_BLOCKS:
            return f"a machine can have at most {MAX_BLOCKS} blocks"
        kinds = {step.id: step.type for step in steps}
        old = set(self.machine.steps)
        for step in steps:
            if step in old:
                continue
            fault = type_problem(step.type, self.brief.blocks, two_ended=step.two_ended)
            if fault:
                return fault[1]
            for parent, face in step.attachments:
                problem = face_problem(parent, kinds[parent], face)
                if problem:
                    return problem
        return ""
