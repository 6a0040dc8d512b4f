"""Contacts in MuJoCo: which blocks and things touched in the last step, and how hard."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agentflow.env.physics.engine import Touch, touch_order
from agentflow.env.physics.frames import swap
from agentflow.env.physics.mujoco.bodies import Built
from agentflow.env.rollout import Array
from agentflow.env.tasks.base import Body
from agentflow.machine.geometry.vectors import Vec3


class Contacts:
    """What touched what in the last step; nothing before the first."""

    def __init__(self, built: Built) -> None:
        self._data, self._owners = built.data, built.owners
        self._geoms = np.zeros((0, 2), dtype=np.intp)
        self._places: Array = np.zeros((0, 3))
        self._rows = np.zeros(0, dtype=np.intp)
        self._forces: Array = np.zeros(0)
        self._sorted: dict[tuple[int, int], tuple[Body, Body]] = {}
        """Owners of two shapes in the order of a touch: sorting them takes longer."""

    def read(self) -> None:
        """Read the contacts of a step, before the second half of it replaces them."""
        data = self._data
        contact = data.contact
        self._geoms, self._places = contact.geom.copy(), contact.pos.copy()
        self._rows = contact.efc_address.copy()
        self._forces = data.efc_force.copy()

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing was in contact with."""
        found = set()
        for one, other in self._pairs():
            if one == body:
                found.add(other)
            elif other == body:
                found.add(one)
        return frozenset(found - {body})

    def all(self) -> list[Touch]:
        """Everything that was in contact."""
        found: dict[tuple[Body, Body], tuple[float, float, Vec3]] = {}
        forces = [*self._forces.tolist(), 0.0]  # contacts without force: row -1
        for shapes, row, (x, y, z) in zip(
            self._geoms.tolist(), self._rows.tolist(), self._places.tolist(), strict=True
        ):
            pair, force = self._sort(*shapes), forces[row]
            if pair[0] == pair[1]:
                continue
            total, most, place = found.get(pair, (0.0, -1.0, (x, y, z)))
            if force > most:
                most, place = force, (x, y, z)
            found[pair] = total + force, most, place
        return [Touch(*pair, swap(place), total) for pair, (total, _, place) in found.items()]

    def _sort(self, one: int, other: int) -> tuple[Body, Body]:
        """The owners of two shapes, in the order of a touch."""
        if (one, other) not in self._sorted:
            first, last = sorted((self._owners[one], self._owners[other]), key=touch_order)
            self._sorted[one, other] = first, last
        return self._sorted[one, other]

    def _pairs(self) -> Iterator[tuple[Body, Body]]:
        owners = self._owners
        return ((owners[one], owners[other]) for one, other in self._geoms.tolist())
