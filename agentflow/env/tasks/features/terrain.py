"""Rough terrain, and single obstacles on a road: quarter-pipe, beam, cone and bumps."""

from collections.abc import Iterator
from math import asin, atan2, ceil, cos, degrees, hypot, pi, sin
from random import Random

from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD, tilted_plate, wall
from agentflow.env.tasks.knobs import knob
from agentflow.machine.geometry.vectors import about_axis

SLAB = 3.0
"""Side of a slab, m."""
THICK = 1.0
"""Thickness of a slab, m; most of it is underground."""
LEAN = 0.3
"""Largest part that a slab's tilt contributes to the height of its corners."""
SOIL, STONE = (0.58, 0.55, 0.43, 1.0), (0.5, 0.5, 0.52, 1.0)


class Roughness(Parameters):
    """Random height of the ground."""

    height: float = knob(0, 0, 1, "m", "maximum height of the ground; 0 keeps it flat")
    first: float = knob(10, 10, 200, "m", "z where uneven ground begins")
    last: float = knob(200, 20, 500, "m", "z where uneven ground ends")

    def objects(self, width: float, seed: int) -> Iterator[SceneObject]:
        """Adjacent slabs with tilted tops, up to `height` above the ground."""
        if not self.height:
            return
        rng = Random(f"ground {seed}")
        columns, rows = ceil(width / SLAB), max(0, ceil((self.last - self.first) / SLAB))
        for row in range(rows):
            for column in range(columns):
                side = width / columns
                x = (column + 0.5) * side - width / 2
                z = self.first + (row + 0.5) * SLAB
                rise = self.height * rng.uniform(LEAN, 1 - LEAN)
                tilt = rng.uniform(0, LEAN * self.height) / hypot(side / 2, SLAB / 2)
                turn = rng.uniform(0, 2 * pi)
                yield SceneObject(
                    f"slab {row + 1}-{column + 1}",
                    "box",
                    (side, THICK, SLAB),
                    (x, rise - THICK / 2, z),
                    about_axis((cos(turn), 0.0, sin(turn)), tilt),
                    color=SOIL,
                )


class Stones(Parameters):
    """Randomly scattered stones."""

    density: float = knob(0, 0, 0.2, "per m2", "stones per square metre; 0 removes them")
    smallest: float = knob(0.5, 0.1, 3, "m", "minimum diameter")
    largest: float = knob(2, 0.1, 3, "m", "maximum diameter")
    first: float = knob(10, 10, 200, "m", "z where stones begin")
    last: float = knob(200, 20, 500, "m", "z where stones end")
    seed: int = knob(0, 0, 1_000_000, "", "random seed of positions and sizes")

    def objects(self, width: float) -> Iterator[SceneObject]:
        """Fixed balls, half underground."""
        rng = Random(f"stones {self.seed}")
        length = max(0.0, self.last - self.first)
        for index in range(round(self.density * length * width)):
            x, z = rng.uniform(-width / 2, width / 2), rng.uniform(self.first, self.last)
            size = rng.uniform(self.smallest, max(self.smallest, self.largest))
            yield SceneObject(
                f"stone {index + 1}", "sphere", (size, size, size), (x, 0.0, z), color=STONE
            )


FACETS = 8
"""Number of flat pieces of a quarter-pipe."""
PLATE = 0.4
"""Thickness of a quarter-pipe, m."""


class Ramp(Parameters):
    """A quarter-pipe across the road."""

    height: float = knob(0, 0, 6, "m", "height of its upper edge; 0 removes it")
    length: float = knob(6.6, 2, 20, "m", "length along z")
    at: float = knob(19, 10, 200, "m", "z of its middle")

    @property
    def profile(self) -> tuple[float, int, float]:
        """Radius of its arc, m; number of flat pieces, and steepness of the last, degrees."""
        radius, steepest = _arc(self.height, self.length)
        return radius, FACETS, degrees(steepest * (1 - 0.5 / FACETS))

    def objects(self, width: float) -> Iterator[SceneObject]:
        """The quarter-pipe across a road of this width, m."""
        if self.height:
            yield from quarter_pipe("ramp", self.at, self.height, self.length, width)


class Beam(Parameters):
    """A beam across the road for machines to pass under."""

    clearance: float = knob(0, 0, 9.5, "m", "free height below the beam; 0 removes it")
    at: float = knob(8, 5, 200, "m", "z of its middle")
    thickness: float = knob(1, 0.2, 4, "m", "height of the beam, and its length along z")

    def objects(self, width: float) -> Iterator[SceneObject]:
        """The beam across a road of this width, m."""
        if self.clearance:
            size = (width, self.thickness, self.thickness)
            yield wall("beam", 0.0, self.at, size, base=self.clearance)


class Cone(Parameters):
    """A cone on the road."""

    height: float = knob(0, 0, 10, "m", "height of its tip; 0 removes it")
    diameter: float = knob(12, 1, 20, "m", "diameter of its base")
    further: float = knob(15, 0, 200, "m", "distance of its middle from the end of the turn")


def bump(name: str, z: float, height: float, length: float, width: float) -> SceneObject:
    """The top of a cylinder across the road: `height` above the ground, `length` along z, m."""
    radius = (length**2 / 4 + height**2) / (2 * height)
    across = (0.0, 0.0, sin(pi / 4), cos(pi / 4))
    size = (2 * radius, width, 2 * radius)
    return SceneObject(name, "cylinder", size, (0.0, height - radius, z), across, color=WOOD)


def _arc(height: float, length: float) -> tuple[float, float]:
    """Radius (m) and steepest angle (rad) of an arc that starts flat and rises to a height, m."""
    radius = (length**2 + height**2) / (2 * height)
    return radius, asin(length / radius) if height <= radius else pi - asin(length / radius)


def quarter_pipe(
    name: str, z: float, height: float, length: float, width: float
) -> Iterator[SceneObject]:
    """A curved ramp that starts flat and steepens along z+, made of flat plates.

    Args:
        name: Prefix of the plates' names.
        z: Middle of the ramp, m.
        height: Height of its upper edge, m.
        length: Length along z, m.
        width: Width along x, m.
    """
    radius, steepest = _arc(height, length)
    bends = [steepest * index / FACETS for index in range(FACETS + 1)]
    edge = [(z - length / 2 + radius * sin(a), radius * (1 - cos(a))) for a in bends]
    for index in range(FACETS):
        (z0, y0), (z1, y1) = edge[index], edge[index + 1]
        pitch = atan2(y1 - y0, z1 - z0)
        size = (width, PLATE, hypot(z1 - z0, y1 - y0))
        yield tilted_plate(f"{name} {index}", size, ((y0 + y1) / 2, (z0 + z1) / 2), pitch)
