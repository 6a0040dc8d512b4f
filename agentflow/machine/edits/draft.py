"""A machine while it is changed: makes single changes, or refuses them with a reason."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from math import dist
from typing import TYPE_CHECKING, Literal

from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.edits.program import Program
from agentflow.machine.formats.parse import MAX_BLOCKS
from agentflow.machine.geometry.placement import Geometry, place
from agentflow.machine.geometry.pose import FACINGS, ShapeFace
from agentflow.machine.problems import (
    Problem,
    RefusedEdit,
    block_label,
    comma_list,
    face_problem,
    type_problem,
)
from agentflow.machine.tree import Machine, Step, carried_by, renumber
from agentflow.machine.validity import ANYWHERE, MAX_FACES, budget_problems, spatial_problems

if TYPE_CHECKING:
    from agentflow.machine.controllers.model import Controllers

NO_CONTROLS = "this task switches all blocks by its own schedule; remove the line"
End = tuple[int, int]
"""A block and one of its faces."""


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
        self.controllers = machine.controllers
        self.next_id = self.original
        self._moved: list[int] = []
        """The block that the last change has moved, then what it carries."""
        self.brief = brief
        self.limits = ANYWHERE if brief is None else brief.limits
        self._given = 1 if brief is None else len(brief.given)
        self._allowed: Collection[int] = library().core if brief is None else brief.blocks

    def attach(self, kind: int, ends: Sequence[End]) -> Step:
        """Add a block on one face, or between two."""
        two_ended = len(ends) == 2
        if fault := type_problem(kind, self._allowed, two_ended=two_ended):
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
        self._moved = []
        return added

    def detach(self, block: int) -> None:
        """Remove a block that carries nothing; controls no longer name it. Refused if controllers
        do."""
        removed = self.editable(block, "removed")
        carried = [step.id for step in self.steps.values() if block in step.parents]
        if carried:
            what = f"{block_label(block, removed.type)} still carries {comma_list(carried)}"
            raise RefusedEdit("has_children", f"{what}; remove the blocks it carries first")
        del self.steps[block]
        self.program.forget(block)
        self._require_controllers(block)

    def reattach(self, block: int, to: End) -> None:
        """Attach a block, with everything attached to it, to another face."""
        moved = self.movable(block)
        self._require_new_place(moved, (moved.parent, moved.face_id), to)
        self._require_free(to)
        self._reattach(replace(moved, parent=to[0], face_id=to[1]), to[0])

    def reattach_end(self, block: int, end: Literal["a", "b"], to: End) -> None:
        """Attach one end of a two-ended block to another face."""
        moved = self.editable(block, "moved")
        if not moved.two_ended:
            what = f"{block_label(block, moved.type)} has no end {end}"
            raise RefusedEdit("two_ended", f"{what}: write Move without 'end {end}'")
        self._require_new_place(moved, moved.attachments["ab".index(end)], to)
        fields = ("parent", "face_id") if end == "a" else ("parent_b", "face_id_b")
        self._reattach(replace(moved, **dict(zip(fields, to, strict=True))), to[0])

    def _require_new_place(self, moved: Step, place: End, to: End) -> None:
        parent, face = to
        block, carried = moved.id, carried_by(self.steps.values(), moved.id)
        if parent in carried:
            reason = f"block {block} carries block {parent}; choose a parent that it does not carry"
            raise RefusedEdit("parent_not_earlier", reason)
        self._require_face(to)
        if to == place:
            reason = f"block {block} is already on face {face} of block {parent}"
            raise RefusedEdit("no_change", reason)

    def _reattach(self, moved: Step, parent: int) -> None:
        """Put a block in its place that has a new parent."""
        block, carried = moved.id, carried_by(self.steps.values(), moved.id)
        self.steps[block], self._moved = moved, [*carried]
        order = list(self.steps)
        if order.index(parent) > order.index(block):
            for id_ in carried:  # to the end, so that parents come first
                self.steps[id_] = self.steps.pop(id_)

    def retype(self, block: int, kind: int) -> str:
        """Give a block another type; what has changed, in words.

        What is attached to it stays on the face at the same place; if there is none, on the
        nearest face that looks the same way and is free, the one with the lowest id. Refused if
        there is none.
        """
        old = self.editable(block, "replaced")
        if fault := type_problem(kind, self._allowed, two_ended=old.two_ended):
            raise RefusedEdit(*fault)
        if kind == old.type:
            label = block_label(block, kind)
            raise RefusedEdit("no_change", f"{label} has type {kind} already: remove the line")
        faces = self._kept_faces(old, kind)
        said = [f"{block_label(block, old.type)} -> type {library()[kind].label}"]
        for step in list(self.steps.values()):
            if block in step.parents:
                a, *b = (
                    faces[step.id, n] if parent == block else face
                    for n, (parent, face) in enumerate(step.attachments)
                )
                new = replace(step, face_id=a, face_id_b=b[0] if b else None)
                said += [] if new == step else [_moved_faces(block, step, new)]
                self.steps[step.id] = new
        self.steps[block] = replace(old, type=kind)
        group = library()[kind].group
        if group is None:
            named = self.program.naming(block)
            said += [f"control {number} no longer names it" for number in named]
            self.program.forget(block)
        if group != library()[old.type].group:
            self.program.require_groups(block, self.steps.values())
        self._require_controllers(block)
        return "; ".join(said)

    def _kept_faces(self, old: Step, kind: int) -> dict[tuple[int, int], int]:
        """(id, 0 or 1 for its end) of what is attached to a block -> face of its new type."""
        here, there = library()[old.type].faces, library()[kind]
        kept: dict[tuple[int, int], int] = {}
        taken: set[int] = set()
        attached = [
            (step.two_ended, step, number, face)
            for step in self.steps.values()
            for number, (parent, face) in enumerate(step.attachments)
            if parent == old.id
        ]
        found = {
            (step.id, number): [
                (dist(other.position, here[face].position), other.id)
                for other in there.faces
                if other.id in there.open_faces and other.direction == here[face].direction
            ]
            for _, step, number, face in attached
        }
        # Blocks that keep their place choose before those that do not, and before two-ended ones,
        # which need no free face.
        attached.sort(key=lambda item: (item[0], min(found[item[1].id, item[2]], default=(9.0, 0))))
        for two_ended, step, number, face in attached:
            free = [pair for pair in found[step.id, number] if two_ended or pair[1] not in taken]
            if not free:
                word, label = here[face].direction, block_label(step.id, step.type)
                where = f"{label} is on face {face} ({word}) of block {old.id}"
                how = f"no free face {word}: move or remove block {step.id} first"
                raise RefusedEdit("face_not_found", f"{where}, and {there.label} has {how}")
            kept[step.id, number] = min(free)[1]
            if not two_ended:
                taken.add(kept[step.id, number])
        return kept

    def face_towards(self, block: int, directions: str) -> int:
        """The face of a block that looks along an axis of the machine frame.

        Refused unless there is exactly one.

        Args:
            block: The block.
            directions: Where the face looks, such as `x+`; then, if several look there, where it
                lies: of those of `x+z-`, the one furthest to z-.
        """
        placed = self.geometry[block]
        looking, *lying = (directions[at : at + 2] for at in range(0, len(directions), 2))
        shape, closed = placed.shape, library()[placed.type].closed
        faces = [face for face in (shape.faces if shape else ()) if face.id not in closed]
        found = [face for face in faces if face.facing.name == looking]
        if not found:
            ways = comma_list(f"{face.id} {face.facing.name}" for face in faces[:MAX_FACES])
            reason = f"no face of {placed.label} looks along {looking}; its faces look: {ways}"
            raise RefusedEdit("face_not_found", reason)
        for way in lying:
            furthest = max(_along(face, way) for face in found)
            found = [face for face in found if _along(face, way) == furthest]
        if len(found) > 1:
            ids = comma_list(face.id for face in found[:MAX_FACES])
            apart = next(way for way in FACINGS if len({_along(face, way) for face in found}) > 1)
            reason = (
                f"faces {ids} of {placed.label} look along {directions}: choose one by its number, "
                f"or say where it lies, as in {directions}{apart}"
            )
            raise RefusedEdit("ambiguous_face", reason)
        return found[0].id

    def editable(self, block: int, done: str) -> Step:
        """A block that can be `done` (removed, moved, replaced); refuses those that stay."""
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
            how = f"move one of its ends, as in 'Move {block} end a to 0 in 4'"
            raise RefusedEdit("two_ended", f"{what}; {how}")
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
        return spatial_problems(self.geometry, self.limits, self._moved)

    def finish(self) -> tuple[Machine, dict[int, int]]:
        """The renumbered machine, and the map from ids to its ids."""
        return renumber(self.steps.values(), self.program.controls, self.controllers)

    def set_controllers(self, controllers: Controllers | None) -> None:
        """Give the machine other controllers, or none."""
        if controllers is not None:
            from agentflow.machine.controllers.reading import controller_problems  # needs pydantic

            for problem in controller_problems(controllers, self.steps.values()):
                raise RefusedEdit(problem.code, problem.message)
        self.controllers = controllers

    def _require_controllers(self, changed: int) -> None:
        """Refuse a change of a block that the controllers cannot do without."""
        try:
            self.set_controllers(self.controllers)
        except RefusedEdit as refused:
            how = f"{refused.reason}; before block {changed} is changed, write other Controllers"
            raise RefusedEdit(refused.code, how) from None

    def _require_face(self, end: End) -> None:
        parent, face = end
        if fault := face_problem(parent, self.steps[parent].type, face):
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


def _along(face: ShapeFace, way: str) -> int:
    """How far a face lies along a direction, in units."""
    return sum(a * b for a, b in zip(face.offset, FACINGS[way].front, strict=True))


def _moved_faces(parent: int, before: Step, after: Step) -> str:
    """Which faces of a parent a block changed."""
    pairs = zip(before.attachments, after.attachments, strict=True)
    changed = (f"{a[1]} to {b[1]}" for a, b in pairs if a != b)
    return f"block {before.id}: face {comma_list(changed)} of block {parent}"
