"""Thrusters and propeller blades, and the forces they exert in their parts' own axes.

On plain floats: machines have few of them, and arrays only pay for many.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import PartForce, PartLocations
from agentflow.env.physics.rows import Row
from agentflow.machine.geometry.vectors import Vec3, dot, rotate_vector, scale


@dataclass(frozen=True)
class Thruster:
    """A steady push on a part at its centre, while `motors` are on."""

    part: int
    force: Vec3
    """N; turns with the part."""


@dataclass(frozen=True)
class PropellerBlade:
    """A propeller blade: its motion through the air exerts a force on it, powered or not."""

    part: int
    push: Vec3
    """Unit vector of the force, the blade's Up."""
    normal: Vec3
    """Unit vector; the force is proportional to the velocity along it."""
    drag: float
    """kg s/m2: force over velocity along the normal and squared speed."""
    speed_cap: float
    """m/s; beyond it the squared speed in the law grows no further."""


class ThrustForce:
    """Constant thrust, while `motors` are on."""

    def __init__(self, thrusters: Sequence[Thruster], levels: Mapping[str, float]) -> None:
        """Convert the thrusters; `levels` of the schedule's entries are read in every step."""
        self._levels = levels
        self._pushes: list[PartForce] = [(each.part, swap(each.force), None) for each in thrusters]

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:  # noqa: ARG002
        """Forces in this step."""
        level = self._levels["motors"]
        if level == 1.0:
            return self._pushes
        if not level:
            return []
        return [(part, scale(force, level), None) for part, force, _ in self._pushes]


_Blade = tuple[int, Vec3, Vec3, Vec3, float, float]
"""Part, its offset in its cluster, push, normal, drag and squared speed cap of a blade."""


class BladeForce:
    """Force along a blade's Up from its motion through still air.

    Its size is -drag * (v . n) * min(v . v, cap^2), where v is the velocity of the blade's centre
    over the ground and n its Up turned by the lift angle: the law of the reference game.
    """

    def __init__(self, blades: Sequence[PropellerBlade], locations: PartLocations) -> None:
        self._blades: dict[int, list[_Blade]] = {}
        """By row, as blades of one cluster share its motion."""
        for blade in blades:
            row, offset = locations.locate(blade.part)
            square_cap = blade.speed_cap * blade.speed_cap
            law = blade.part, offset, swap(blade.push), swap(blade.normal), blade.drag, square_cap
            self._blades.setdefault(row, []).append(law)

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step."""
        pushes: list[PartForce] = []
        for row, blades in self._blades.items():
            _, _, _, x, y, z, w, vx, vy, vz, wx, wy, wz = rows[row]
            to_local = (-x, -y, -z, w)
            wx, wy, wz = rotate_vector(to_local, (wx, wy, wz))
            vx, vy, vz = rotate_vector(to_local, (vx, vy, vz))
            for part, (x, y, z), (p, q, r), normal, drag, square_cap in blades:
                velocity = vx + (wy * z - wz * y), vy + (wz * x - wx * z), vz + (wx * y - wy * x)
                size = -drag * dot(velocity, normal) * min(dot(velocity, velocity), square_cap)
                pushes.append((part, (p * size, q * size, r * size), None))
        return pushes
