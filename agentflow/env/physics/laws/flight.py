"""Thrusters and propeller blades, and the forces they exert in their parts' own axes.

On plain floats: machines have few of them, and arrays only pay for many.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import dist

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, part_motion
from agentflow.env.physics.rows import Row
from agentflow.machine.geometry.vectors import Vec3, add, dot, rotate_vector, scale


@dataclass(frozen=True)
class Thruster:
    """A steady push on a part at its centre, while it is on."""

    part: int
    force: Vec3
    """N; turns with the part."""
    steam: float | None = None
    """Factor of the force while a flame heats the part's centre; None: flames do not matter."""
    starts: Entry = "motors"
    """The entry whose level it follows."""


@dataclass(frozen=True)
class Heat:
    """A flame on a part, which heats parts whose centres it reaches."""

    part: int
    offset: Vec3
    """From the part's centre to the flame's, m; turns with the part."""
    radius: float
    """m."""


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
    """Constant thrust, while thrusters are on; greater while a flame heats those of steam."""

    def __init__(
        self,
        thrusters: Sequence[Thruster],
        levels: Mapping[Entry, float],
        flames: Sequence[Heat],
        locations: PartLocations,
    ) -> None:
        """Convert the thrusters and flames; `levels` of entries are read in every step."""
        self._levels, self._locations = levels, locations
        self._pushes = [(each, swap(each.force)) for each in thrusters]
        self._flames = [(each.part, swap(each.offset), each.radius) for each in flames]

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """Forces in this step."""
        levels = self._levels
        return [
            (each.part, scale(force, level * self._factor(each, rows)), None)
            for each, force in self._pushes
            if (level := levels.get(each.starts, 0.0))
        ]

    def _factor(self, thruster: Thruster, rows: Sequence[Row]) -> float:
        """The factor of its force."""
        if thruster.steam is None:
            return 1.0
        middle = self._place(thruster.part, (0.0, 0.0, 0.0), rows)
        heated = any(
            dist(middle, self._place(part, offset, rows)) <= radius
            for part, offset, radius in self._flames
        )
        return thruster.steam if heated else 1.0

    def _place(self, part: int, offset: Vec3, rows: Sequence[Row]) -> Vec3:
        """A point of a part, at rest `offset` from its centre."""
        row, arm = self._locations.locate(part)
        return part_motion(rows[row], add(arm, offset))[0]


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
