"""Moves: every change that one step can make to a machine, legal or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from random import Random

from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine, Step, renumber

Move = Callable[[Random], Machine | None]
"""Makes a changed machine; None if a two-ended block has no other block for its second end."""


def additions(machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every standard type on every free face, and every two-ended type on every face.

    The second end of a two-ended block is on a random face of another block.
    """
    faces, free = list(_faces(machine)), _free_faces(machine)
    return [
        partial(_add, machine, kind, *end)
        for kind in types
        for end in (faces if library()[kind].linear else free)
    ]


def _add(machine: Machine, kind: int, parent: int, face_id: int, rng: Random) -> Machine | None:
    step = Step(len(machine), kind, parent, face_id)
    if library()[kind].linear:
        ends = [end for end in _faces(machine) if end[0] != parent]
        if not ends:
            return None
        parent_b, face_b = rng.choice(ends)
        step = replace(step, parent_b=parent_b, face_id_b=face_b)
    return replace(machine, steps=(*machine.steps, step))


def removals(machine: Machine, types: Sequence[int]) -> list[Move]:  # noqa: ARG001
    """Removal of every block except the root that has nothing attached."""
    carrying = {parent for step in machine for parent in step.parents}
    return [
        partial(_remove, machine, step) for step in machine.steps[1:] if step.id not in carrying
    ]


def _remove(machine: Machine, removed: Step, rng: Random) -> Machine:  # noqa: ARG001
    kept = (step for step in machine if step is not removed)
    return renumber(kept, machine.controls)[0]


def swaps(machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every block except the root, as every other type with as many ends."""
    return [
        partial(_change, machine, replace(step, type=kind))
        for step in machine.steps[1:]
        for kind in types
        if kind != step.type and library()[kind].linear == step.two_ended
    ]


def _change(machine: Machine, new: Step, rng: Random) -> Machine:  # noqa: ARG001
    steps = tuple(new if step.id == new.id else step for step in machine)
    return replace(machine, steps=steps)


def reattachments(machine: Machine, types: Sequence[int]) -> list[Move]:  # noqa: ARG001
    """Every standard block on every free face of every earlier block except its parent."""
    return [
        partial(_change, machine, step)
        for step in _reattached_steps(machine)
        if step.parent != machine[step.id].parent
    ]


def reorientations(machine: Machine, types: Sequence[int]) -> list[Move]:  # noqa: ARG001
    """Every standard block on every free face of its parent that faces another way."""
    geometry = place(machine)

    def facing(step: Step) -> str:
        return geometry[step.parent].faces[step.face_id].facing

    return [
        partial(_change, machine, step)
        for step in _reattached_steps(machine)
        if step.parent == machine[step.id].parent and facing(step) != geometry[step.id].facing
    ]


def actuations(machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every block replaced by its counterpart with, or without, a motor."""
    return [
        partial(_change, machine, replace(step, type=other))
        for step in machine
        if (other := library()[step.type].counterpart) is not None and other in types
    ]


Kinds = Mapping[str, Callable[[Machine, Sequence[int]], Sequence[Move]]]
"""Kinds of edits, each with a function of a machine and the types that may be added."""

MOVES: Kinds = {
    "add": additions,
    "remove": removals,
    "swap": swaps,
    "re-attach": reattachments,
    "re-orient": reorientations,
    "actuate": actuations,
}
"""Kind of edit -> function that lists all moves of that kind, legal or not; those of control
programs are in `control_moves`."""


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
