"""Owns what thrusters and blades exert on clusters, on plain floats: a machine has few of them.

Each law takes the rows of kinematics.py and gives wrenches in the cluster's own axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.engines.actors import Lift, Thrust
from agentflow.env.engines.forces import Members, Wrench
from agentflow.env.engines.frames import swap
from agentflow.env.engines.kinematics import Row
from agentflow.env.engines.vectors import add, cross, dot, scale, turned
from agentflow.env.scene import Vec3


class Thrusters:
    """Pushes that do not change, summed per cluster once."""

    def __init__(
        self, thrusts: Sequence[Thrust], members: Members, levels: Mapping[str, float]
    ) -> None:
        """Sum up.

        Args:
            thrusts: All of them.
            members: Where the parts are.
            levels: How far each schedule entry is switched on; looked up at every step.
        """
        self._levels = levels
        sums: dict[int, tuple[Vec3, Vec3]] = {}
        for thrust in thrusts:
            row, offset = members.place(thrust.part)
            force = swap(thrust.force)
            total = sums.get(row, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
            sums[row] = (add(total[0], force), add(total[1], cross(offset, force)))
        self._wrenches = [Wrench(row, True, *total) for row, total in sums.items()]

    def __call__(self, rows: Sequence[Row]) -> list[Wrench]:  # noqa: ARG002
        """What they do in this step."""
        level = self._levels["motors"]
        if level == 1.0:
            return self._wrenches
        return [
            Wrench(row, True, scale(force, level), scale(torque or force, level))
            for row, _, force, torque in (self._wrenches if level else ())
        ]


class Blades:
    """Propeller blades: force along a blade's Up, by how the blade cuts through the air.

    -drag * (v . n) * min(v . v, cap^2), v the velocity of the blade's centre over the ground, n
    its Up turned by the lift angle (`data/reference_physics.json`).
    """

    def __init__(self, lifts: Sequence[Lift], members: Members) -> None:
        """Set up."""
        self._blades = [
            (*members.place(lift.part), swap(lift.push), swap(lift.normal), lift.drag, cap * cap)
            for lift in lifts
            for cap in (lift.speed_cap,)
        ]

    def __call__(self, rows: Sequence[Row]) -> list[Wrench]:
        """What they do in this step."""
        wrenches = []
        for row, offset, push, normal, drag, most in self._blades:
            _, _, _, x, y, z, w, vx, vy, vz, wx, wy, wz = rows[row]
            back = (-x, -y, -z, w)
            spin = turned(back, (wx, wy, wz))
            velocity = add(turned(back, (vx, vy, vz)), cross(spin, offset))
            size = -drag * dot(velocity, normal) * min(dot(velocity, velocity), most)
            force = scale(push, size)
            wrenches.append(Wrench(row, True, force, cross(offset, force)))
        return wrenches
