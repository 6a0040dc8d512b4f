"""Owns what thrusters and blades exert on their blocks; plain floats, as machines have few.

Each law takes the rows of kinematics.py and gives forces in the part's own axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.actors import Lift, Thrust
from agentflow.env.physics.frames import swap
from agentflow.env.physics.kinematics import Row
from agentflow.env.physics.laws.air import Members, Push
from agentflow.env.physics.vectors import add, cross, dot, scale, turned


class Thrusters:
    """Pushes that do not change."""

    def __init__(self, thrusts: Sequence[Thrust], levels: Mapping[str, float]) -> None:
        """Set up.

        Args:
            thrusts: All of them.
            levels: How far each schedule entry is switched on; looked up at every step.
        """
        self._levels = levels
        self._pushes = [Push(thrust.part, swap(thrust.force), None) for thrust in thrusts]

    def __call__(self, rows: Sequence[Row]) -> list[Push]:  # noqa: ARG002
        """What they do in this step."""
        level = self._levels["motors"]
        if level == 1.0:
            return self._pushes
        return [
            Push(part, scale(force, level), None)
            for part, force, _ in (self._pushes if level else ())
        ]


class Blades:
    """Propeller blades: force along a blade's Up, by how the blade cuts through the air.

    -drag * (v . n) * min(v . v, cap^2), v the velocity of the blade's centre over the ground, n
    its Up turned by the lift angle (`data/reference_physics.json`).
    """

    def __init__(self, lifts: Sequence[Lift], members: Members) -> None:
        """Set up."""
        self._blades = [
            (
                lift.part,
                *members.place(lift.part),
                swap(lift.push),
                swap(lift.normal),
                lift.drag,
                cap * cap,
            )
            for lift in lifts
            for cap in (lift.speed_cap,)
        ]

    def __call__(self, rows: Sequence[Row]) -> list[Push]:
        """What they do in this step."""
        pushes = []
        for part, row, offset, push, normal, drag, most in self._blades:
            _, _, _, x, y, z, w, vx, vy, vz, wx, wy, wz = rows[row]
            back = (-x, -y, -z, w)
            spin = turned(back, (wx, wy, wz))
            velocity = add(turned(back, (vx, vy, vz)), cross(spin, offset))
            size = -drag * dot(velocity, normal) * min(dot(velocity, velocity), most)
            pushes.append(Push(part, scale(push, size), None))
        return pushes
