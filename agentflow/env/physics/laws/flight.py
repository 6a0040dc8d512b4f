"""Thrusters and propeller blades, and the forces they exert in their parts' own axes.

On plain floats: machines have few of them, and arrays only pay for many.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, dist, radians, sin
from typing import ClassVar

from agentflow.env.physics.frames import swap
from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, part_motion
from agentflow.env.physics.laws.motion import MotionDevice
from agentflow.env.physics.rows import Row
from agentflow.machine.blocks.types import BlockType
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, add, dot, scale


@dataclass(frozen=True)
class Thruster:
    """A steady push of `force` (N) on a part at its centre, while its entry `starts` is on; it
    turns with the part."""

    part: int
    force: Vec3
    steam: float | None = None
    """Factor of the force while a flame heats the part's centre; None: flames do not matter."""
    starts: Entry = "motors"


@dataclass(frozen=True)
class Heat:
    """A flame on a part, which heats parts whose centres it reaches.

    Its middle is at `offset` from the part's centre, with which it turns; m.
    """

    part: int
    offset: Vec3
    radius: float


@dataclass(frozen=True)
class PropellerBlade(MotionDevice):
    """A propeller blade: its motion through still air pushes it along its Up, powered or not.

    The force is -drag * (v . n) * min(v . v, square_cap), where v is the velocity of the blade's
    centre over the ground and n, its `normal`, is its Up turned about its Front by the lift angle:
    the law of the reference game. In SI units.
    """

    loss: ClassVar[str] = "the lift of blades"
    up: Vec3
    normal: Vec3
    drag: float
    square_cap: float

    @classmethod
    def of(cls, block: Placed, kind: BlockType, part: int) -> PropellerBlade | None:
        blade = kind.blade
        if blade is None:
            return None
        angle = radians(blade.lift_angle_deg)
        normal = add(scale(block.up, cos(angle)), scale(block.right, -sin(angle)))
        cap = blade.speed_cap * blade.speed_cap
        return cls(part, swap(block.up), swap(normal), blade.axial_drag, cap)

    def scaled(self, factor: float) -> PropellerBlade:
        return replace(self, drag=self.drag * factor)

    def push(self, velocity: Vec3) -> Vec3:
        square = dot(velocity, velocity)
        return scale(
            self.up, -self.drag * dot(velocity, self.normal) * min(square, self.square_cap)
        )


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
