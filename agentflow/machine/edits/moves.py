"""Moves: every change that one step can make to a machine or its control program, legal or not."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from random import Random

from agentflow.machine.blocks.library import library
from agentflow.machine.controls import MAX_CONTROLS, PRECISION, driven_blocks
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Control, Machine, Step, renumber

Move = Callable[[Random], Machine | None]
"""Makes a changed machine; None if a two-ended block has no other block for its second end."""
MOST_BLOCKS = 4
"""Most blocks of a random entry that names blocks, such as the wheels of one side."""
STEP = 0.1
"""Random times (s) and levels are multiples of this."""


def additions(machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every standard type on every free face, and every two-ended type on every face.

    The second end of a two-ended block is on a random face of another block.
    """
    faces, free = list(faces_of(machine)), free_faces(machine)
    return [
        partial(_add, machine, kind, *end)
        for kind in types
        for end in (faces if library()[kind].linear else free)
    ]


def _add(machine: Machine, kind: int, parent: int, face_id: int, rng: Random) -> Machine | None:
    step = Step(len(machine), kind, parent, face_id)
    if library()[kind].linear:
        ends = [end for end in faces_of(machine) if end[0] != parent]
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
    return renumber(kept, machine.controls, machine.controllers)[0]


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
programs are from `control_moves`."""


def faces_of(steps: Iterable[Step]) -> Iterator[tuple[int, int]]:
    """(block id, face id) of all open faces of these blocks."""
    return ((step.id, face) for step in steps for face in library()[step.type].open_faces)


def free_faces(machine: Machine) -> list[tuple[int, int]]:
    """(block id, face id) of all open faces without a standard block."""
    taken = {(step.parent, step.face_id) for step in machine if not step.two_ended}
    return [end for end in faces_of(machine) if end not in taken]


def _reattached_steps(machine: Machine) -> Iterator[Step]:
    """Every standard block except the root, on every free face of every earlier block."""
    free = free_faces(machine)
    for step in machine.steps[1:]:
        if not step.two_ended:
            for parent, face in free:
                if parent < step.id:
                    yield replace(step, parent=parent, face_id=face)


def random_control(machine: Machine, window: float, rng: Random) -> Control | None:
    """An entry for a random group, or for a few random blocks of one; None if nothing is driven.

    Args:
        machine: what it is for.
        window: latest end of a control, s.
        rng: random generator.
    """
    driven = driven_blocks(machine)
    if not driven:
        return None
    group = rng.choice(sorted(set(driven.values())))
    blocks = [block for block, own in driven.items() if own == group]
    some = rng.sample(blocks, rng.randint(1, min(len(blocks), MOST_BLOCKS)))
    return _timed(rng.choice((group, tuple(sorted(some)))), window, rng)


def _timed(target: tuple[int, ...] | str, window: float, rng: Random) -> Control:
    """An entry for a target, at random times within the window and a random level."""
    most = max(1, int(window / STEP))
    begin = rng.randrange(most)
    end = rng.randint(begin + 1, most)
    level = rng.choice((-1, 1)) * rng.randint(1, 10)
    times = (min(window, step * STEP) for step in (begin, end - begin))
    at, lasts, share = (round(number, PRECISION) for number in (*times, level * STEP))
    return Control(target, at, lasts, share)  # type: ignore[arg-type]


def _added(window: float, machine: Machine, rng: Random) -> Machine | None:
    new = random_control(machine, window, rng)
    if new is None or len(machine.controls) >= MAX_CONTROLS:
        return None
    return replace(machine, controls=(*machine.controls, new))


def _changed(window: float, machine: Machine, number: int, rng: Random) -> Machine:
    entry = _timed(machine.controls[number].target, window, rng)
    return with_entries(machine, number, (entry,), rng)


def with_entries(
    machine: Machine,
    number: int,
    entries: tuple[Control, ...],
    rng: Random,  # noqa: ARG001
) -> Machine:
    """The machine with other entries in place of one."""
    controls = (*machine.controls[:number], *entries, *machine.controls[number + 1 :])
    return replace(machine, controls=controls)


def control_moves(window: float) -> Kinds:
    """Kinds of edits of control programs that end within the window, s; as `moves.MOVES`."""
    return {
        "control": lambda machine, _types: [partial(_added, window, machine)],
        "uncontrol": lambda machine, _types: [
            partial(with_entries, machine, n, ()) for n in range(len(machine.controls))
        ],
        "retime": lambda machine, _types: [
            partial(_changed, window, machine, n) for n in range(len(machine.controls))
        ],
    }


def with_random_program(machine: Machine, window: float, rng: Random, most: int = 4) -> Machine:
    """The machine with one to `most` more random entries, if something in it is driven."""
    for _ in range(rng.randint(1, most)):
        machine = _added(window, machine, rng) or machine
    return machine
