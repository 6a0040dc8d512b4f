"""Owns how a machine grows block by block: what may be hung where, seen from its geometry.

Which blocks a mechanism needs is mechanisms.py's.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Iterable, Sequence

from agentflow.machine.blocks import STARTING_BLOCK, library
from agentflow.machine.geometry import Geometry, Placed, PlacedFace, place
from agentflow.machine.tree import ROOT, Machine, Step


class Growth:
    """A machine that only ever grows, and only validly: what does not fit is not added."""

    def __init__(
        self,
        machine: Machine | None,
        types: Collection[int],
        limit: Sequence[float],
        chance: random.Random,
    ) -> None:
        """Start from a machine, or from the root; `limit` is the greatest extent x, y, z in m."""
        self.machine = machine or Machine((ROOT,))
        self.geometry = place(self.machine)
        self.chance = chance
        self.types = types
        self._limit = limit

    def choose(self, wanted: Iterable[int]) -> int | None:
        """One of the wanted types that may be used, by chance; None if there is none."""
        found = [kind for kind in wanted if kind in self.types]
        return self.chance.choice(found) if found else None

    def add(self, kind: int | None, *ends: tuple[int, int]) -> int | None:
        """Hang a type on (block, face), or between two such ends; its id, None if not valid."""
        if kind is None or len(ends) != (2 if library()[kind].linear else 1):
            return None
        second = ends[1] if len(ends) == 2 else (None, None)
        step = Step(len(self.machine), kind, *ends[0], *second)
        machine = Machine((*self.machine.steps, step))
        geometry = place(machine)
        large = any(have > most for have, most in zip(geometry.size, self._limit, strict=True))
        if large or geometry.overlaps or locked(geometry):
            return None
        self.machine, self.geometry = machine, geometry
        return step.id

    def hang(
        self, kind: int | None, parent: int | None, towards: str, place_from_end: int = 0
    ) -> int | None:
        """Hang a type on a face that looks `towards`, counted from the parent's far end."""
        if parent is None:
            return None
        faces = self.free(parent, towards)
        back = self.geometry[parent].origin
        faces.sort(key=lambda face: -_distance(face.position, back))
        index = min(place_from_end, len(faces) - 1)
        return self.add(kind, (parent, faces[index].face_id)) if faces else None

    def chain(self, kind: int | None, parent: int, towards: str, count: int) -> int:
        """Hang `count` blocks one behind the other; the id of the last that fits."""
        for _ in range(count):
            added = self.hang(kind, parent, towards)
            if added is None:
                break
            parent = added
        return parent

    def free(self, block: int, towards: str = "") -> list[PlacedFace]:
        """Free faces of a block, all or those that look `towards`."""
        ids = set(self.geometry.free_faces(block))
        faces = self.geometry[block].faces
        return [f for f in faces if f.face_id in ids and towards in ("", f.facing)]

    def of(self, *kinds: int) -> list[int]:
        """Ids of the blocks of these types."""
        return [step.id for step in self.machine if step.type in kinds]


def clusters(geometry: Geometry) -> tuple[int, ...]:
    """For each block the id of the block at which its rigid cluster begins; two-ended: its own."""
    first: list[int] = []
    for placed in geometry.blocks:
        moves = library()[placed.type].non_stable or placed.two_ended
        whole = placed.type == STARTING_BLOCK or moves
        first.append(placed.id if whole else first[placed.step.parent])
    return tuple(first)


def locked(geometry: Geometry) -> bool:
    """Whether a closed loop bridges a moving joint, which locks it."""
    group = clusters(geometry) if geometry.auto_connections else ()
    return any(group[loop.block] != group[loop.partner] for loop in geometry.auto_connections)


def is_free(geometry: Geometry, block: Placed, face: PlacedFace) -> bool:
    """Whether nothing hangs on the face."""
    return face.face_id in geometry.free_faces(block.id)


def _distance(a: Sequence[float], b: Sequence[float]) -> float:
    return sum(abs(x - y) for x, y in zip(a, b, strict=True))
