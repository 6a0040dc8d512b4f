"""Forces applied in every step: air, springs, thrusters, blades, winches."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from agentflow.env.physics.laws.select import Forces, Law, Power
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco.bodies import CompiledModel
from agentflow.env.physics.mujoco.sensing import Rows
from agentflow.env.physics.rows import POSITION
from agentflow.env.physics.structure.layout import RowLayout
from agentflow.env.physics.structure.spanning_tree import Skeleton
from agentflow.machine.geometry.vectors import Vec3, cross, rotate_vector, subtract

_STILL = (0.0, 0.0, 0.0)
_PACK, _SIZE = Struct("6d").pack_into, 48
"""Writes the force and torque on a body, which take so many bytes; faster than assigning to an
array."""


class AppliedForces(Forces):
    """Applies forces; MuJoCo keeps them until they are changed."""

    def __init__(
        self,
        built: CompiledModel,
        assembly: Assembly,
        plan: Skeleton,
        layout: RowLayout,
        rows: Rows,
        laws: Sequence[Law],
    ) -> None:
        super().__init__(assembly, plan, layout, rows, laws)
        self._known = rows
        objects = [built.objects[name] for name in layout.objects]
        self._leading = [built.parts[part] for part in layout.leading] + objects
        self.at = [*built.parts, *objects]
        """Body of each part and moving object."""
        self._row = [
            *layout.locations.row.tolist(),
            *range(len(layout.leading), len(self._leading)),
        ]
        self.dragged = [self._leading[row] for row in self.drag.rows]
        """Bodies on which drag acts."""
        self._count = len(assembly.parts)
        self._target = built.data.xfrc_applied.data
        self.written: set[int] = set()
        """Bodies on which forces acted in the last step."""

    def __call__(self) -> None:
        rows = self._read
        if not self.laws:  # nothing else acts
            for at, wrench in zip(self.dragged, self.drag.turned(rows), strict=True):
                _PACK(self._target, at * _SIZE, *wrench)
            return
        total = dict(zip(self.dragged, map(list, self.drag.turned(rows)), strict=True))
        for forces in self._of_laws(rows):
            for part, force, place in forces:
                if place is None:
                    _, _, _, x, y, z, w, *_ = rows[self._row[part]]
                    force = rotate_vector((x, y, z, w), force)
                own = total.setdefault(self.at[part], [0.0] * 6)
                own[0] += force[0]
                own[1] += force[1]
                own[2] += force[2]
                if part >= self._count and place is not None:
                    self._turn(own, part, force, place)
        self._write(total)

    def power(self) -> Power:
        known = self._known.air
        return super().power() if known is None else Power(0.0, known)

    def _write(self, total: dict[int, list[float]]) -> None:
        """Replace the forces of the last step."""
        if self.written != total.keys():
            for body in self.written - total.keys():
                _PACK(self._target, body * _SIZE, *_STILL, *_STILL)
            self.written = set(total)
        for body, wrench in total.items():
            _PACK(self._target, body * _SIZE, *wrench)

    def _turn(self, own: list[float], part: int, force: Vec3, place: Vec3) -> None:
        """Add the torque of a force on an object at a place other than its centre of mass."""
        row = self._rows.all[self._row[part]]
        for i, moment in enumerate(cross(subtract(place, row[POSITION]), force), 3):
            own[i] += moment
