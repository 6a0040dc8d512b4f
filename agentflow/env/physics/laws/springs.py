"""Owns what springs exert on the parts that they hold; plain floats, as machines have few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.kinematics import Row
from agentflow.env.physics.laws.air import Members, Push
from agentflow.env.physics.model import Pull
from agentflow.env.physics.vectors import add, cross, dot, length, scale, subtract, turned
from agentflow.env.scene import Vec3


class Springs:
    """The pulls of all springs, while `springs` are on."""

    def __init__(
        self, pulls: Sequence[Pull], members: Members, levels: Mapping[str, float]
    ) -> None:
        """Set up.

        Args:
            pulls: All of them.
            members: Where the parts are.
            levels: How far each schedule entry is switched on, looked up at every step: the share
                of a pull; springs cannot push, so below 0 they exert nothing.
        """
        self._levels = levels
        self._pulls = [(pull, members.place(pull.a), members.place(pull.b)) for pull in pulls]

    def __call__(self, rows: Sequence[Row]) -> list[Push]:
        """What they do in this step."""
        level = max(self._levels["springs"], 0.0)
        if not level:
            return []
        pushes = []
        for pull, (row_a, offset_a), (row_b, offset_b) in self._pulls:
            at_a, speed_a = end_of(rows[row_a], offset_a)
            at_b, speed_b = end_of(rows[row_b], offset_b)
            line = subtract(at_b, at_a)
            distance = max(length(line), 1e-9)
            stretch = min((distance - pull.natural) / pull.ramp, 1.0)
            if stretch <= 0.0:
                continue
            along = scale(line, 1.0 / distance)
            parting = dot(subtract(speed_b, speed_a), along)
            strength = max(pull.force * stretch + pull.damping * parting, 0.0)
            force = scale(along, level * strength)
            pushes += [Push(pull.a, force, at_a), Push(pull.b, scale(force, -1.0), at_b)]
        return pushes


def end_of(row: Row, offset: Vec3) -> tuple[Vec3, Vec3]:
    """Place and velocity of a part's centre, `offset` (at rest) from its cluster's leading one."""
    px, py, pz, x, y, z, w, vx, vy, vz, wx, wy, wz = row
    arm = turned((x, y, z, w), offset)
    return add((px, py, pz), arm), add((vx, vy, vz), cross((wx, wy, wz), arm))
