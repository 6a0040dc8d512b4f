"""Owns upright rings: where they stand, what passes through them, and what that is worth.

Which motion counts as a flight is the families'; flying calls its rings hoops.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import cos, dist, hypot, inf, pi, sin, tan

from agentflow.env.scene import Thing, Vec3

EACH, CLOSE = 10.0, 10.0
"""Points of a ring that was passed; most points for coming close to the next one (spec 3)."""
HALF = 0.5
"""Points that each metre from the next ring's centre costs a boulder (spec 3)."""
SIDES = 24
THICK = 0.4
"""Of the ring's body, m."""
PAINT = (0.86, 0.5, 0.2, 1.0)


@dataclass(frozen=True)
class Ring:
    """A ring across z+."""

    centre: Vec3
    """m."""
    radius: float
    """Of the opening, m."""

    def things(self, name: str) -> Iterator[Thing]:
        """Its body: straight pieces around the opening."""
        x, y, z = self.centre
        middle = self.radius + THICK / 2
        length = 2 * (self.radius + THICK) * tan(pi / SIDES)
        for index in range(SIDES):
            angle = 2 * pi * index / SIDES
            yield Thing(
                f"{name}, piece {index + 1}",
                "box",
                (THICK, length, THICK),
                (x + middle * cos(angle), y + middle * sin(angle), z),
                (0.0, 0.0, sin(angle / 2), cos(angle / 2)),
                color=PAINT,
            )

    def passed(self, before: Vec3, now: Vec3) -> bool:
        """Whether the way between two places crosses the opening towards z+."""
        z = self.centre[2]
        if not before[2] < z <= now[2]:
            return False
        share = (z - before[2]) / (now[2] - before[2])
        x = before[0] + share * (now[0] - before[0])
        y = before[1] + share * (now[1] - before[1])
        return hypot(x - self.centre[0], y - self.centre[1]) < self.radius


class Passage:
    """One flight towards rings that have to be passed in order."""

    def __init__(self, rings: Sequence[Ring], cost: float = HALF) -> None:
        """Nothing is passed yet.

        Args:
            rings: In order.
            cost: Points that each metre from the next ring's centre costs.
        """
        self._rings, self._cost = rings, cost
        self._before: Vec3 | None = None
        self.passed = 0
        """How many rings."""
        self.closest = inf
        """Least distance to the next ring's centre since the last one was passed, m."""

    def watch(self, place: Vec3) -> None:
        """Go on to the next place of the flight."""
        if self._before is not None:
            while self.passed < len(self._rings) and self._rings[self.passed].passed(
                self._before, place
            ):
                self.passed, self.closest = self.passed + 1, inf
        self._before = place
        if self.passed < len(self._rings):
            self.closest = min(self.closest, dist(place, self._rings[self.passed].centre))

    @property
    def score(self) -> float:
        """10 for each ring, and up to 10 for coming close to the next."""
        close = (
            0.0 if self.passed == len(self._rings) else max(0.0, CLOSE - self._cost * self.closest)
        )
        return EACH * self.passed + close
