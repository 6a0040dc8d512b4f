"""Local edits: what an engineer would try on a machine that works, for searches that climb.

Besides the moves of random edits: longer and shorter chains, the same change on both sides, every
block of a type at once, and small changes of times. A choice of ours; random edits stay as they
are, since baselines draw them.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from random import Random

from agentflow.errors import UsageError
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.edits.changes import add_images
from agentflow.machine.edits.draft import Draft, End
from agentflow.machine.edits.moves import Kinds, Move, faces_of, free_faces, with_entries
from agentflow.machine.edits.random import draw_legal, kinds_of_moves
from agentflow.machine.problems import RefusedEdit
from agentflow.machine.tree import Machine, Step, renumber
from agentflow.machine.validity import budget_problems

MAX_MISSES = 5
"""Edits of one kind that may be drawn in vain."""
NUDGES = (0.8, 0.9, 1.1, 1.25)
"""Factors of times and levels."""


def local_edit(machine: Machine, rng: Random, brief: Brief) -> tuple[str, Machine]:
    """Apply one random legal edit, as `random_edit` does, of more kinds; with its kind.

    Raises:
        UsageError: There is no legal edit.
    """
    return draw_legal(machine, rng, brief, {**kinds_of_moves(brief), **local_moves(brief)})


def local_edits(
    machine: Machine, rng: Random, brief: Brief, count: int, is_new: Callable[[Machine], bool]
) -> list[Machine]:
    """Machines one legal edit away, all different and new: fewer if there are not as many.

    Novelty comes first: the kinds of edits alternate, so that each has been tried before one is
    tried again.

    Args:
        machine: What is edited.
        rng: Random generator.
        brief: The task.
        count: Most machines.
        is_new: Whether a machine is to be tried; asked once for each.
    """
    kinds = {**kinds_of_moves(brief), **local_moves(brief)}
    turns = list(kinds)
    rng.shuffle(turns)
    misses = dict.fromkeys(turns, 0)
    found: list[Machine] = []
    while turns and len(found) < count:
        kind = turns.pop(0)
        try:
            _, edited = draw_legal(machine, rng, brief, {kind: kinds[kind]})
        except UsageError:
            continue
        if edited != machine and edited not in found and is_new(edited):
            found.append(edited)
        else:
            misses[kind] += 1
        if misses[kind] < MAX_MISSES:
            turns.append(kind)
    return found


def insertions(machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every standard type between every block and its parent."""
    return [
        partial(_insert, machine, step, kind, face)
        for step in machine.steps[1:]
        if not step.two_ended
        for kind in types
        if not library()[kind].linear
        for face in library()[kind].open_faces
    ]


def _insert(machine: Machine, step: Step, kind: int, face: int, rng: Random) -> Machine:
    new = Step(len(machine), kind, step.parent, step.face_id)
    moved = replace(step, parent=new.id, face_id=face)
    return _rebuilt(machine, {step.id: (new, moved)}, rng)


def omissions(machine: Machine, types: Sequence[int]) -> list[Move]:  # noqa: ARG001
    """Every block that carries one standard block, left out: what it carries takes its place."""
    moves: list[Move] = []
    for step in machine.steps[1:]:
        carried = [other for other in machine if step.id in other.parents]
        if not step.two_ended and len(carried) == 1 and not carried[0].two_ended:
            moved = replace(carried[0], parent=step.parent, face_id=step.face_id)
            moves.append(partial(_rebuilt, machine, {step.id: (), moved.id: (moved,)}))
    return moves


def _pairs(brief: Brief, machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every standard type on every free face, with its mirror image."""
    return [
        partial(_add_pair, brief, machine, kind, face)
        for face in free_faces(machine)
        for kind in types
        if not library()[kind].linear
    ]


def _add_pair(
    brief: Brief,
    machine: Machine,
    kind: int,
    face: End,
    rng: Random,  # noqa: ARG001
) -> Machine | None:
    if budget_problems(len(machine) + 2, brief):
        return None
    draft = Draft(machine, brief)
    try:
        add_images(draft, draft.attach(kind, [face]).id)
    except RefusedEdit:
        return None
    return draft.finish()[0]


def retypings(machine: Machine, types: Sequence[int]) -> list[Move]:
    """Every type of the machine in favour of another one, in all its blocks."""
    present = sorted({step.type for step in machine.steps[1:]})
    return [
        partial(
            _rebuilt,
            machine,
            {step.id: (replace(step, type=new),) for step in machine if step.type == old},
        )
        for old in present
        if machine.count(old) > 1
        for new in types
        if new != old and library()[new].linear == library()[old].linear
    ]


def end_moves(machine: Machine, types: Sequence[int]) -> list[Move]:  # noqa: ARG001
    """Either end of every two-ended block on every face of the earlier blocks."""
    moves: list[Move] = []
    for step in machine:
        if step.two_ended:
            for other, face in faces_of(machine.steps[: step.id]):
                for moved in (
                    replace(step, parent=other, face_id=face),
                    replace(step, parent_b=other, face_id_b=face),
                ):
                    if moved.parent != moved.parent_b and moved != step:
                        moves.append(partial(_rebuilt, machine, {step.id: (moved,)}))
    return moves


def nudges(machine: Machine, types: Sequence[int]) -> list[Move]:  # noqa: ARG001
    """Begin, duration or level of every control, a little more or less."""
    moves: list[Move] = []
    for number, control in enumerate(machine.controls):
        for factor, name in product(NUDGES, ("at", "lasts", "level")):
            value = round(getattr(control, name) * factor, 2)
            if name == "level":
                value = max(-1.0, min(1.0, value))
            changed = replace(control, **{name: value})
            moves.append(partial(with_entries, machine, number, (changed,)))
    return moves


def _rebuilt(machine: Machine, by: dict[int, tuple[Step, ...]], rng: Random) -> Machine:  # noqa: ARG001
    """The machine with other steps in place of some, in building order."""
    steps = (new for step in machine for new in by.get(step.id, (step,)))
    return renumber(steps, machine.controls, machine.controllers)[0]


def local_moves(brief: Brief) -> Kinds:
    """Kind of edit -> function that lists all moves of that kind, legal or not."""
    return {
        "insert": insertions,
        "leave out": omissions,
        "add a pair": partial(_pairs, brief),
        "swap all": retypings,
        "move an end": end_moves,
        "nudge": nudges,
    }
