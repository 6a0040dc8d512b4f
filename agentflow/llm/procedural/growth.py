"""Owns how a machine grows block by block: what may be hung where, seen from its geometry.

Which blocks a mechanism needs is mechanisms.py's.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from math import dist

from agentflow.llm.procedural.reading import Facts
from agentflow.machine.blocks import STARTING_BLOCK, library
from agentflow.machine.geometry import Geometry, PlacedFace, place
from agentflow.machine.tree import ROOT, Machine, Step


class Growth:
    """A machine that only ever grows, and only validly: what does not fit is not added."""

    def __init__(self, facts: Facts, chance: random.Random) -> None:
        """Start from the machine of a prompt, or from the root; only its types are added."""
        self.machine = facts.machine or Machine((ROOT,))
        self.geometry = place(self.machine)
        self.types, self.chance, self._brief = facts.types, chance, facts.brief

    def choose(self, *wanted: Sequence[int]) -> int | None:
        """A usable type, by chance, of the first of these groups that has any."""
        usable = ([kind for kind in group if kind in self.types] for group in wanted)
        found = next(filter(None, usable), None)
        return self.chance.choice(found) if found else None

    def add(self, kind: int | None, *ends: tuple[int, int]) -> int | None:
        """Hang a type on (block, face), or between two such ends; its id, None if not valid."""
        if kind is None or len(ends) != 1 + library()[kind].linear:
            return None
        if self.machine.count(kind) == self._brief.required.get(kind):
            return None
        step = Step(len(self.machine), kind, *(part for end in ends for part in end))
        geometry = place(Machine((*self.machine.steps, step)))
        limits = zip(geometry.size, self._brief.size_limit, strict=True)
        if any(a > b for a, b in limits) or geometry.overlaps or locked(geometry):
            return None
        self.machine, self.geometry = Machine((*self.machine.steps, step)), geometry
        return step.id

    def hang(self, kind: int | None, parent: int, towards: str, skip: int = 0) -> int | None:
        """Hang a type on a face that looks `towards`, `skip` faces before the parent's far end."""
        back = self.geometry[parent].origin
        faces = free(self.geometry, parent, towards)
        faces.sort(key=lambda face: -dist(back, face.position))
        return self.add(kind, (parent, faces[min(skip, len(faces) - 1)].face_id)) if faces else None

    def chain(self, kind: int | None, parent: int, towards: str, count: int) -> int:
        """Hang `count` blocks one behind the other; the id of the last that fits."""
        for _ in range(count):
            added = self.hang(kind, parent, towards)
            parent = parent if added is None else added
        return parent


def free(geometry: Geometry, block: int, towards: str = "") -> list[PlacedFace]:
    """Free faces of a block, all or those that look `towards`."""
    ids = geometry.free_faces(block)
    return [f for f in geometry[block].faces if f.face_id in ids and f.facing.startswith(towards)]


def clusters(geometry: Geometry) -> tuple[int, ...]:
    """For each block the block at which its rigid cluster begins; 0 for what stands still."""
    first: list[int] = []
    for placed in geometry.blocks:
        moves = library()[placed.type].non_stable or placed.type == STARTING_BLOCK
        first.append(placed.id if moves or placed.two_ended else first[placed.step.parent])
    return tuple(first)


def locked(geometry: Geometry) -> bool:
    """Whether a closed loop bridges a moving joint, which locks it."""
    group = clusters(geometry) if geometry.auto_connections else ()
    return any(group[loop.block] != group[loop.partner] for loop in geometry.auto_connections)
