"""Obstacles to jump over: walls, or a trench between banks, and a slope before them."""

from collections.abc import Iterator
from math import cos, radians, tan
from typing import ClassVar

from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import tilted_plate, wall
from agentflow.env.tasks.knobs import knob
from agentflow.machine.geometry.vectors import Vec3

WIDTH = 60.0
"""Extent of every obstacle along x, m: too wide to go around."""
BANK_BACK, BANK_AHEAD = 25.0, 150.0
"""Extent of the banks behind z = 0 and beyond the trench, m."""
LIP = 0.15
"""Gap between the top of a trench's far wall and the bank, m; lets machines land on the edge."""
SKIN = 0.02
"""How far the far wall juts out from its bank, so that it is touched first, m."""
PLATE = 0.2
"""Thickness of the slope, m."""


class Walls(Parameters):
    """Upright walls across z+."""

    count: int = knob(1, 1, 5, "", "number of walls")
    first: float = knob(12, 9.5, 50, "m", "z of the first wall's middle")
    spacing: float = knob(12, 1.5, 50, "m", "distance between walls")
    height: float = knob(0.5, 0.1, 5, "m", "height of the walls")
    thickness: float = knob(0.5, 0.1, 2, "m", "thickness of the walls")

    @property
    def places(self) -> list[float]:
        """z of each wall's middle, m."""
        return [self.first + index * self.spacing for index in range(self.count)]

    @property
    def near_side(self) -> float:
        """z of the near side of the first wall, m."""
        return self.first - self.thickness / 2

    @property
    def far_side(self) -> float:
        """z of the far side of the last wall, m."""
        return self.places[-1] + self.thickness / 2

    @property
    def condition(self) -> str:
        """What trials vary, in a phrase."""
        middles = " and ".join(f"{z:.2f}" for z in self.places)
        return f"wall{'s' * (self.count > 1)} {self.height:.2f} m high at z = {middles} m"

    @property
    def watched(self) -> tuple[str, ...]:
        """Names of the objects that no block may touch."""
        return tuple(f"wall {index}" for index in range(1, self.count + 1))

    def objects(self, friction: float) -> Iterator[SceneObject]:
        """The walls."""
        size: Vec3 = (WIDTH, self.height, self.thickness)
        for name, z in zip(self.watched, self.places, strict=True):
            yield wall(name, 0.0, z, size, friction)


class Trench(Parameters):
    """A trench across z+; it replaces the walls, and the machine starts on its near bank."""

    length: float = knob(0, 0, 20, "m", "length along z from bank to bank; 0 removes it")
    depth: float = knob(3, 1, 10, "m", "depth")
    at: float = knob(15, 12, 50, "m", "z of its middle")

    watched: ClassVar[tuple[str, ...]] = ("ground", "far wall")
    """Names of the objects that no block may touch."""

    @property
    def near_side(self) -> float:
        """z of the near bank's edge, m."""
        return self.at - self.length / 2

    @property
    def far_side(self) -> float:
        """z of the far bank's edge, m."""
        return self.at + self.length / 2

    @property
    def condition(self) -> str:
        """What trials vary, in a phrase."""
        return f"trench {self.depth:.2f} m deep from z = {self.near_side:.2f} m"

    def objects(self, friction: float) -> Iterator[SceneObject]:
        """Both banks, and the far wall."""
        near, far = self.near_side, self.far_side
        long = near + BANK_BACK
        yield wall("near bank", 0.0, near - long / 2, (WIDTH, self.depth, long), friction)
        ahead: Vec3 = (WIDTH, self.depth, BANK_AHEAD)
        yield wall("far bank", 0.0, far + BANK_AHEAD / 2, ahead, friction)
        yield wall("far wall", 0.0, far, (WIDTH, self.depth - LIP, 2 * SKIN), friction)


class Slope(Parameters):
    """A slope that rises towards the first obstacle."""

    angle: float = knob(0, 0, 30, "degrees", "steepness; 0 removes it")
    length: float = knob(3, 1, 10, "m", "length along z")
    before: float = knob(0, 0, 10, "m", "distance from its upper edge to the first obstacle")

    @property
    def rise(self) -> float:
        """Height of its upper edge above its foot, m."""
        return self.length * tan(radians(self.angle))

    def objects(self, obstacle: float, base: float, friction: float) -> Iterator[SceneObject]:
        """The slope, on ground at height `base`, before an obstacle at z = `obstacle`; m."""
        if self.angle:
            pitch, edge = radians(self.angle), obstacle - self.before
            size = (WIDTH, PLATE, self.length / cos(pitch))
            top = (base + self.rise / 2, edge - self.length / 2)
            yield tilted_plate("slope", size, top, pitch, friction)
