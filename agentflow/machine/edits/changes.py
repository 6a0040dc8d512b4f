"""Changes of several blocks at once, crossover, and which changes a machine with problems allows.

Each change takes a draft and returns the block to go on with: the new or moved one, or the parent
of what was removed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import dist
from random import Random

from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.edits.commands import Side
from agentflow.machine.edits.draft import Draft, End
from agentflow.machine.geometry.placement import flip, mirrored_face, place, place_step
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.problems import Problem, RefusedEdit, block_label
from agentflow.machine.tree import Machine, Step, carried_by, rename_blocks, renumber
from agentflow.machine.validity import check, task_problems

Change = Callable[[Draft], int]
"""Changes a draft; the block to go on with."""


def add(draft: Draft, kind: int, ends: Sequence[End]) -> int:
    """Attach a new block to one face, or between two."""
    return draft.attach(kind, ends).id


def remove(draft: Draft, block: int) -> int:
    """Remove a block with everything that is attached to it."""
    parent = draft.editable(block, "removed").parent
    for carried in reversed(carried_by(draft.steps.values(), block)):
        draft.detach(carried)
    return parent


def move(draft: Draft, block: int, to: End) -> int:
    """Attach a block, with what it carries, to another face."""
    draft.reattach(block, to)
    return block


def copy(draft: Draft, block: int, to: End) -> int:
    """Attach a copy of a block, and of what only it carries, to a face."""
    step = draft.steps[block]
    if step.two_ended or block == 0:
        label = block_label(block, step.type)
        raise RefusedEdit("not_copied", f"{label} cannot be copied; copy a block that it holds")
    _, *carried = carried_by(draft.steps.values(), block, alone=True)
    ids = {block: draft.attach(step.type, [to]).id}
    for old in carried:
        ends = [(ids[parent], face) for parent, face in draft.steps[old].attachments]
        ids[old] = draft.attach(draft.steps[old].type, ends).id
    return ids[block]


def mirror(draft: Draft, block: int) -> int:
    """Add the mirror images of a block and of what it carries; the first of them."""
    return min(add_images(draft, block).values())


def add_images(draft: Draft, what: int | Side) -> dict[int, int]:
    """Add mirror images, x+ and x- of the root exchanged: block -> its new image.

    The plane is x = 0 through the middle of the root. A block that has its image already, a block
    of its type there, gets no other. Refused if what a block is attached to has no image, and if
    there is nothing to add. Controls stay as they are.

    Args:
        draft: What gets the images.
        what: A block, with all that it carries; or a side, with every block whose middle is there.
    """
    if what == 0:
        reason = "the root is its own mirror image; choose a block that it holds"
        raise RefusedEdit("not_mirrored", reason)
    placed = {item.id: item for item in draft.geometry.blocks}
    images = {old: placed[new] for old, new in _images(placed).items()}
    if isinstance(what, int):
        blocks = carried_by(draft.steps.values(), what)
    else:
        sign = 1 if what == "x+" else -1
        blocks = [id_ for id_, b in placed.items() if sign * (b.lo[0] + b.hi[0]) > 0]
    added = {}
    for old in blocks:
        if old in images:
            continue
        ends = [
            _image_of_face(placed[parent], face, images)
            for parent, face in placed[old].step.attachments
        ]
        try:
            step = draft.attach(placed[old].type, ends)
        except RefusedEdit as refused:
            reason = f"for the mirror image of {placed[old].label}: {refused.reason}"
            raise RefusedEdit(refused.code, reason) from None
        images[old] = placed[step.id] = place_step(step, placed)
        added[old] = step.id
    if not added:
        which = "every block there" if isinstance(what, str) else "the block and what it carries"
        reason = f"Mirror {what} adds nothing: {which} has its mirror image already"
        raise RefusedEdit("no_change", reason)
    return added


@dataclass(frozen=True)
class Mending:
    """Changes of one machine at a task, each of the machine as it is.

    A change is legal if it brings no problem that the machine does not have already, and not more
    blocks of a type than the task requires. So a machine with problems, such as an imported one,
    can be repaired step by step.
    """

    machine: Machine
    brief: Brief

    def make(self, change: Change) -> tuple[Machine, int]:
        """The changed machine, and the block to go on with.

        Raises:
            Refused: The change is not legal; the reason lists no free faces, which people see.
        """
        draft = Draft(self.machine, self.brief)
        try:
            chosen = change(draft)
            for problem in (*self._surplus(draft), *draft.problems, *draft.crowding):
                if (problem.code, problem.blocks) not in self._known:
                    raise RefusedEdit(problem.code, problem.message)
        except RefusedEdit as refused:
            reason, _, _ = refused.reason.partition("; free faces of")
            raise RefusedEdit(refused.code, reason) from None
        machine, ids = draft.finish()
        return machine, ids.get(chosen, 0)

    def turn(self, block: int) -> tuple[Machine, int]:
        """As `make`, for a move to the next face of its parent that is legal.

        Raises:
            Refused: There is none; says why not the next one.
        """
        refusals = []
        for end in self._other_faces(block):
            try:
                return self.make(partial(move, block=block, to=end))
            except RefusedEdit as refused:
                refusals.append(refused)
        none = RefusedEdit("face_occupied", "its parent has no other free face to turn to")
        raise refusals[0] if refusals else none

    def fix(self, block: int) -> tuple[Machine, int]:
        """As `make`, for a move to the nearest face where the machine has fewer problems.

        Raises:
            Refused: There is none.
        """
        geometry, before = place(self.machine), len(check(self.machine, self.brief).problems)
        carried = carried_by(self.machine, block)
        ends = [
            (dist(placed.faces[face].position, geometry[block].center), (placed.id, face))
            for placed in geometry.blocks
            if placed.id not in carried
            for face in geometry.free_faces(placed.id)
        ]
        for _, end in sorted(ends):
            with suppress(RefusedEdit):
                moved = self.make(partial(move, block=block, to=end))
                if len(check(moved[0], self.brief).problems) < before:
                    return moved
        label = block_label(block, self.machine[block].type)
        raise RefusedEdit("not_fixed", f"{label} has no free face with fewer problems; remove it")

    def _other_faces(self, block: int) -> Iterator[End]:
        """The free faces of a block's parent, in order from its own."""
        step = self.machine[block]
        if not step.two_ended and block != 0:
            free = place(self.machine).free_faces(step.parent)
            for face in sorted(free, key=lambda face: (face < step.face_id, face)):
                yield step.parent, face

    def _surplus(self, draft: Draft) -> Iterator[Problem]:
        """More blocks of a type than the task requires, and than there were."""
        for problem in task_problems(draft.geometry, self.brief):
            for kind in {draft.steps[block].type for block in problem.blocks}:
                if len(problem.blocks) > max(self.brief.required[kind], self.machine.count(kind)):
                    yield problem

    @cached_property
    def _known(self) -> set[tuple[str, tuple[int, ...]]]:
        """The problems that the machine has already."""
        draft = Draft(self.machine, self.brief)
        return {(each.code, each.blocks) for each in (*draft.problems, *draft.crowding)}


def _images(placed: Mapping[int, Placed]) -> dict[int, int]:
    """Block -> the block that stands where its mirror image would."""
    where = {
        (item.type, item.lo, item.hi, frozenset((item.at, item.far))): item.id
        for item in placed.values()
    }
    found = {}
    for item in placed.values():
        lo, hi = (-item.hi[0], *item.lo[1:]), (-item.lo[0], *item.hi[1:])
        ends = frozenset((flip(item.at), item.far and flip(item.far)))
        other = where.get((item.type, lo, hi, ends))
        if other is not None:
            found[item.id] = other
    return found


def _image_of_face(parent: Placed, face: int, images: Mapping[int, Placed]) -> End:
    """The face that is where the mirror image of a face would be."""
    image = images.get(parent.id)
    if image is None or image.shape is None or parent.shape is None:
        reason = f"{parent.label} has no mirror image to attach to; mirror it first"
        raise RefusedEdit("not_mirrored", reason)
    found = mirrored_face(parent, face, image)
    if found is None:
        reason = f"{parent.label} has no face where the mirror image of its face {face} is"
        raise RefusedEdit("not_mirrored", reason)
    return image.id, found


MAX_TRIES = 100
"""Maximum number of pairs of parts that are tried; a choice of ours."""


def cross(machine: Machine, donor: Machine, rng: Random, brief: Brief | None = None) -> Machine:
    """Replace a part of a machine by a part of another machine.

    A part is a block with everything attached to it. Pairs of parts are drawn uniformly until the
    result is another machine, valid and as the task demands. Two-ended blocks of the machine that
    hold on to the removed part are removed with it; of the donor's, those that end within the part
    come along. So do the donor's controls of blocks in the part.

    Args:
        machine: a valid machine.
        donor: another one; it is not changed.
        rng: random generator.
        brief: the task; the core types and the standard building volume if None.

    Raises:
        UsageError: None of `MAX_TRIES` pairs fits.
    """
    given = 1 if brief is None else len(brief.given)
    # Parts begin with standard blocks that are not given.
    places, parts = (
        [step for step in each.steps[given:] if not step.two_ended] for each in (machine, donor)
    )
    for _ in range(MAX_TRIES if places and parts else 0):
        crossed = _graft(machine, rng.choice(places), donor, rng.choice(parts))
        if crossed in (machine, donor):
            continue
        report = check(crossed, brief)
        if report.task_valid and report.machine is not None:
            return report.machine
    raise UsageError("no part of the donor fits in place of a part of this machine")


def _graft(machine: Machine, place: Step, donor: Machine, part: Step) -> Machine:
    removed = {*carried_by(machine, place.id)}
    brought = {*carried_by(donor, part.id, alone=True)}
    moved = [_shifted(step, len(machine)) for step in donor if step.id in brought]
    moved[0] = replace(moved[0], parent=place.parent, face_id=place.face_id)
    driving = (each for each in donor.controls if isinstance(each.target, tuple))
    ids = {block: block + len(machine) for block in brought}
    controls = (*machine.controls, *rename_blocks(driving, ids))
    kept = (step for step in machine if step.id not in removed)
    return renumber([*kept, *moved], controls, machine.controllers)[0]


def _shifted(step: Step, by: int) -> Step:
    """The step with all ids increased."""
    far = None if step.parent_b is None else step.parent_b + by
    return replace(step, id=step.id + by, parent=step.parent + by, parent_b=far)
