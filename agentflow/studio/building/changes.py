"""Changes of a machine by hand, legal or not: add, move, copy, mirror, remove.

A changed machine keeps the ids of its blocks, and new blocks have new ones, so that problems before
and after a change can be compared; ids may then have gaps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from agentflow.errors import UsageError
from agentflow.machine import Machine, Step, library, place
from agentflow.machine.geometry.pose import Placed, Units3
from agentflow.machine.problems import block_label

End = tuple[int, int]
"""A block and one of its faces."""


@dataclass(frozen=True)
class Change:
    """A machine as it would be."""

    steps: tuple[Step, ...]
    """Parents come before their children."""
    chosen: int
    """The block to go on with: the new or moved one, or the parent of what was removed."""


def add(machine: Machine, kind: int, ends: Sequence[End]) -> Change:
    """Attach a new block to one face, or between two."""
    step = Step(len(machine), kind, *(part for end in ends for part in end))
    return Change((*machine.steps, step), step.id)


def remove(machine: Machine, block: int) -> Change:
    """Remove a block with everything that is attached to it."""
    gone = set(subtree(machine, block))
    return Change(tuple(s for s in machine if s.id not in gone), max(machine[block].parent, 0))


def move(machine: Machine, block: int, to: End) -> Change:
    """Attach a block, with what it carries, to another face.

    Raises:
        UsageError: It is two-ended, or would carry itself.
    """
    moved = machine[block]
    carried = subtree(machine, block)
    if moved.two_ended:
        raise UsageError(f"{_label(moved)} is two-ended; remove it and attach it anew")
    if to[0] in carried:
        raise UsageError(f"{_label(moved)} carries block {to[0]}, so it cannot be attached to it")
    new = replace(moved, parent=to[0], face_id=to[1])
    kept = [step for step in machine if step.id not in carried]
    rest = [new if step.id == block else step for step in machine if step.id in carried]
    if to[0] < block:  # no need to change the order
        return Change(tuple(new if step.id == block else step for step in machine), block)
    return Change((*kept, *rest), block)


def turns(machine: Machine, block: int) -> Iterator[Change]:
    """Move a block to each other face of its parent, in order from its own."""
    step = machine[block]
    if step.two_ended or step.parent < 0:
        return
    faces = library()[machine[step.parent].type].open_faces
    free = place(machine).free_faces(step.parent)
    after = [face for face in faces if face > step.face_id]
    before = [face for face in faces if face < step.face_id]
    for face in (*after, *before):
        if face in free:
            yield move(machine, block, (step.parent, face))


def copy(machine: Machine, block: int, to: End) -> Change:
    """Attach a copy of a block, and of what only it carries, to a face.

    Raises:
        UsageError: It is two-ended, or the root.
    """
    if machine[block].two_ended or block == 0:
        raise UsageError(f"{_label(machine[block])} cannot be copied; copy a block that it holds")
    ids = _new_ids(machine, _own_subtree(machine, block))
    made = [_renamed(machine[old], ids) for old in ids]
    made[0] = replace(made[0], parent=to[0], face_id=to[1])
    return Change((*machine.steps, *made), ids[block])


def mirror(machine: Machine, block: int) -> Change:
    """Add the mirror image of a block and of what it carries, left and right of the root exchanged.

    Raises:
        UsageError: What it is attached to has no mirror image, or this is the root.
    """
    if block == 0:
        raise UsageError("the root is its own mirror image; choose a block that it holds")
    placed = {item.id: item for item in place(machine).blocks}
    ids = _new_ids(machine, subtree(machine, block))
    steps = list(machine.steps)
    images = {old: placed[new] for old, new in _images(placed).items()}
    for old, new in ids.items():
        ends = [
            _image_of_face(placed[parent], face, images)
            for parent, face in placed[old].step.attachments
        ]
        step = Step(new, placed[old].type, *(part for end in ends for part in end))
        steps.append(step)
        images[old] = place(steps)[new]
    return Change(tuple(steps), ids[block])


def subtree(machine: Machine, block: int) -> list[int]:
    """Ids of a block and of everything that is attached to it, in building order."""
    found = [block]
    for step in machine:
        if not set(found).isdisjoint(step.parents):
            found.append(step.id)
    return found


def _own_subtree(machine: Machine, block: int) -> list[int]:
    """Without the two-ended blocks that are attached to something else as well."""
    found = [block]
    for step in machine:
        if step.parents and set(step.parents) <= set(found):
            found.append(step.id)
    return found


def _new_ids(machine: Machine, blocks: Sequence[int]) -> dict[int, int]:
    return {old: len(machine) + index for index, old in enumerate(blocks)}


def _renamed(step: Step, ids: dict[int, int]) -> Step:
    second = None if step.parent_b is None else ids[step.parent_b]
    parent = ids.get(step.parent, step.parent)
    return replace(step, id=ids[step.id], parent=parent, parent_b=second)


def _images(placed: dict[int, Placed]) -> dict[int, int]:
    """Block -> the block that stands where its mirror image would."""
    where = {(item.type, item.lo, item.hi, item.at): item.id for item in placed.values()}
    found = {}
    for item in placed.values():
        lo, hi = (-item.hi[0], *item.lo[1:]), (-item.lo[0], *item.hi[1:])
        other = where.get((item.type, lo, hi, _flip(item.at)))
        if other is not None and not item.two_ended:
            found[item.id] = other
    return found


def _image_of_face(parent: Placed, face: int, images: dict[int, Placed]) -> End:
    """The face that is where the mirror image of a face would be."""
    image = images.get(parent.id)
    if image is None or image.shape is None or parent.shape is None:
        raise UsageError(f"{parent.label} has no mirror image to attach to; mirror it first")
    wanted = _flip(_at(parent, face))
    for candidate in image.shape.faces:
        if _at(image, candidate.id) == wanted:
            return image.id, candidate.id
    raise UsageError(f"{parent.label} has no face where the mirror image of its face {face} is")


def _at(placed: Placed, face: int) -> Units3:
    assert placed.shape is not None
    (x, y, z), (u, v, w) = placed.at, placed.shape.faces[face].offset
    return (x + u, y + v, z + w)


def _flip(point: Units3) -> Units3:
    return (-point[0], point[1], point[2])


def _label(step: Step) -> str:
    return block_label(step.id, step.type)
