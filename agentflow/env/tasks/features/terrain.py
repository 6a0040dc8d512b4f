"""Rough terrain: scattered stones and slabs of random height and tilt."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, cos, hypot, pi, sin
from random import Random

from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters
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

    def sentences(self) -> Iterator[str]:
        """Describe the ground to designers."""
        if self.height:
            yield (
                f"From z = {self.first:g} m to z = {self.last:g} m the ground is uneven: slabs "
                f"{SLAB:g} m long and about as wide, tilted at random, rise up to "
                f"{self.height:g} m."
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

    def sentences(self) -> Iterator[str]:
        """Describe the stones to designers."""
        if self.density:
            yield (
                f"From z = {self.first:g} m to z = {self.last:g} m stones are scattered over the "
                f"whole road, {self.density:g} per square metre: fixed balls, {self.smallest:g} to "
                f"{self.largest:g} m in diameter, half buried in the ground."
            )
