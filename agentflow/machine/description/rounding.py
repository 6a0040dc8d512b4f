"""Numbers for models: relative to the ground and rounded."""

import math
from dataclasses import dataclass

from agentflow.machine.geometry.balance import HALF_UNITS, moments
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.geometry.pose import UNITS, Placed, Units3
from agentflow.machine.geometry.vectors import Vec3, length, subtract


@dataclass(frozen=True)
class GroundFrame:
    """Machine frame with y = 0 at the machine's lowest corner; metres, one decimal."""

    ground: int
    """Height of the lowest corner in the machine frame, in units."""

    def point(self, at: Units3) -> Vec3:
        """A point given in the machine frame, in units."""
        return self._rounded((at[0], at[1] - self.ground, at[2]), UNITS)

    def center(self, placed: Placed) -> Vec3:
        """Centre of a block's box."""
        lo, hi = placed.lo, placed.hi
        twice = (lo[0] + hi[0], lo[1] + hi[1] - 2 * self.ground, lo[2] + hi[2])
        return self._rounded(twice, HALF_UNITS)

    def centre_of_mass(self, geometry: Geometry) -> Vec3:
        """Centre of mass."""
        (x, y, z), scale = moments(geometry)
        return self._rounded((x, y - self.ground * scale // UNITS, z), scale)

    def _rounded(self, fraction: Units3, scale: int) -> Vec3:
        x, y, z = (one_decimal(value, scale) for value in fraction)
        return (x, y, z)


def one_decimal(value: int, scale: int) -> float:
    """`value / scale` with one decimal, halves rounded away from zero."""
    tenths = (20 * abs(value) + scale) // (2 * scale)
    return (tenths if value >= 0 else -tenths) / 10


def span_of(placed: Placed) -> tuple[float, Vec3 | None]:
    """Length of a two-ended block in metres, and its direction from end a to end b.

    The length has one decimal, the unit vector two; it is None if the ends coincide.
    """
    assert placed.far is not None
    along = subtract(placed.far, placed.at)
    span = length(along)
    if span == 0:
        return 0.0, None
    x, y, z = (_two_decimals(part / span) for part in along)
    return math.floor(span / UNITS * 10 + 0.5) / 10, (x, y, z)


def _two_decimals(value: float) -> float:
    return math.copysign(math.floor(abs(value) * 100 + 0.5) / 100, value) if value else 0.0
