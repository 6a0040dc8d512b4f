"""Moves: every change that one step can make to a machine, legal or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from random import Random
from typing import NamedTuple

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine, Step, renumber


class Addition(NamedTuple):
    """Adds a block on a face; a two-ended block runs from there to a random face."""

    machine: Machine
    type: int
    parent: int
    face_id: int

    def apply(self, rng: Random) -> Machine | None:
        """The machine with the block; None if there is no other block for a second end."""
        steps = self.machine.steps
        step = Step(len(steps), self.type, self.parent, self.face_id)
        if library()[self.type].linear:
            ends = [end for end in _faces(self.machine) if end[0] != self.parent]
            if not ends:
                return None
            parent_b, face_b = rng.choice(ends)
            step = replace(step, parent_b=parent_b, face_id_b=face_b)
        return Machine((*steps, step))


class Change(NamedTuple):
    """Changes the type or the place of a block."""

    machine: Machine
    step: Step
    """New step of the block with this id."""

    def apply(self, rng: Random) -> Machine:  # noqa: ARG002
        """The machine with the block changed."""
        steps = self.machine.steps
        return Machine((*steps[: self.step.id], self.step, *steps[self.step.id + 1 :]))


class Removal(NamedTuple):
    """Removes a block."""

    machine: Machine
    id: int

    def apply(self, rng: Random) -> Machine:  # noqa: ARG002
        """The machine without the block, renumbered."""
        return renumber(step for step in self.machine if step.id != self.id)[0]


Move = Addition | Change | Removal


def additions(machine: Machine, types: Sequence[int]) -> list[Addition]:
    """Every type on every free face, and two-ended types on every face."""
    faces, free = list(_faces(machine)), _free_faces(machine)
    return [
        Addition(machine, kind, *end)
        for kind in types
        for end in (faces if library()[kind].linear else free)
    ]


def removals(machine: Machine, types: Sequence[int]) -> list[Removal]:  # noqa: ARG001
    """Removal of every block except the root that has nothing attached."""
    carrying = {parent for step in machine for parent in step.parents}
    return [Removal(machine, step.id) for step in machine.steps[1:] if step.id not in carrying]


def swaps(machine: Machine, types: Sequence[int]) -> list[Change]:
    """Every block except the root, as every other type with as many ends."""
    return [
        Change(machine, replace(step, type=kind))
        for step in machine.steps[1:]
        for kind in types
        if kind != step.type and library()[kind].linear == step.two_ended
    ]


def reattachments(machine: Machine, types: Sequence[int]) -> list[Change]:  # noqa: ARG001
    """Every standard block on every free face of every earlier block except its parent."""
    return [
        Change(machine, step)
        for step in _reattached_steps(machine)
        if step.parent != machine[step.id].parent
    ]


def reorientations(machine: Machine, types: Sequence[int]) -> list[Change]:  # noqa: ARG001
    """Every standard block on every free face of its parent that faces another way."""
    geometry = place(machine)

    def facing(step: Step) -> str:
        return geometry[step.parent].faces[step.face_id].facing

    return [
        Change(machine, step)
        for step in _reattached_steps(machine)
        if step.parent == machine[step.id].parent and facing(step) != geometry[step.id].facing
    ]


def actuations(machine: Machine, types: Sequence[int]) -> list[Change]:
    """Every block replaced by its counterpart with, or without, a motor."""
    return [
        Change(machine, replace(step, type=other))
        for step in machine
        if (other := library()[step.type].counterpart) is not None and other in types
    ]


MOVES: Mapping[str, Callable[[Machine, Sequence[int]], Sequence[Move]]] = {
    "add": additions,
    "remove": removals,
    "swap": swaps,
    "re-attach": reattachments,
    "re-orient": reorientations,
    "actuate": actuations,
}
"""Kind of edit -> function that lists all moves of that kind, legal or not."""


def _faces(machine: Machine) -> Iterator[tuple[int, int]]:
    """(block id, face id) of all open faces."""
    return ((step.id, face) for step in machine for face in library()[step.type].open_faces)


def _free_faces(machine: Machine) -> list[tuple[int, int]]:
    """(block id, face id) of all open faces without a standard block."""
    taken = {(step.parent, step.face_id) for step in machine if not step.two_ended}
    return [end for end in _faces(machine) if end not in taken]


def _reattached_steps(machine: Machine) -> Iterator[Step]:
    """Every standard block except the root, on every free face of every earlier block."""
    free = _free_faces(machine)
    for step in machine.steps[1:]:
        if not step.two_ended:
            for parent, face in free:
                if parent < step.id:
                    yield replace(step, parent=parent, face_id=face)
