"""Banks: raised flat ground beside lower ground, on which machines are set down."""

from __future__ import annotations

from typing import NamedTuple

from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import Vec3, subtract

BESIDE = 1e-6
"""What overlaps by less only touches, m."""


class Bank(NamedTuple):
    """A box along the axes, on the top of which machines are set down.

    The middle of a machine's bounding box is over x = z = 0.
    """

    name: str
    top: float
    """y, m; the ground around it is at y = 0."""
    low: tuple[float, float]
    """Least x and z, m."""
    high: tuple[float, float]
    """Greatest x and z, m."""

    def is_under(self, placed: Placed, middle: Vec3) -> bool:
        """Whether a block is above or below its top, with the machine's middle over x = z = 0."""
        low, high = subtract(placed.box_min, middle), subtract(placed.box_max, middle)
        return not placed.two_ended and all(
            low[axis] < greatest - BESIDE and high[axis] > least + BESIDE
            for axis, least, greatest in zip((0, 2), self.low, self.high, strict=True)
        )

    def reaches(self, point: Vec3, middle: Vec3) -> bool:
        """Whether a point (machine frame, m) is above or below its top or at its edge."""
        place = subtract(point, middle)
        return all(
            least - BESIDE <= place[axis] <= greatest + BESIDE
            for axis, least, greatest in zip((0, 2), self.low, self.high, strict=True)
        )
