"""Upright rings, progress through them, and its score. The flying family calls them hoops."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, dist, hypot, inf, pi, sin, tan

from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.vectors import Vec3, about_axis

EACH, CLOSE = 10.0, 10.0
"""Points for passing a ring, and most points for coming close to the next one."""
HALF = 0.5
"""Points that a boulder loses per metre from the next ring's centre."""
SIDES = 24
THICK = 0.4
"""Thickness of a ring's body, m."""
COLOR = (0.86, 0.5, 0.2, 1.0)


@dataclass(frozen=True)
class Ring:
    """An upright ring that faces z, with its centre and its inner radius, m."""

    centre: Vec3
    radius: float

    def objects(self, name: str) -> Iterator[SceneObject]:
        """Straight pieces that form the ring's body."""
        x, y, z = self.centre
        middle = self.radius + THICK / 2
        length = 2 * (self.radius + THICK) * tan(pi / SIDES)
        for index in range(SIDES):
            angle = 2 * pi * index / SIDES
            yield SceneObject(
                f"{name}, piece {index + 1}",
                "box",
                (THICK, length, THICK),
                (x + middle * cos(angle), y + middle * sin(angle), z),
                about_axis((0.0, 0.0, 1.0), angle),
                color=COLOR,
            )

    def is_passed(self, before: Vec3, now: Vec3) -> bool:
        """Whether the line from one position to another crosses the opening towards z+."""
        z = self.centre[2]
        if not before[2] < z <= now[2]:
            return False
        share = (z - before[2]) / (now[2] - before[2])
        x = before[0] + share * (now[0] - before[0])
        y = before[1] + share * (now[1] - before[1])
        return hypot(x - self.centre[0], y - self.centre[1]) < self.radius


def ring_objects(rings: Iterable[Ring], kind: str) -> Iterator[SceneObject]:
    """The pieces of all rings, named "ring 1, piece 1" or the like."""
    for index, ring in enumerate(rings, start=1):
        yield from ring.objects(f"{kind} {index}")


class RingProgress:
    """Progress of one flight through rings that must be passed in order."""

    def __init__(self, rings: Sequence[Ring], cost: float = HALF) -> None:
        """Start before the first ring.

        Args:
            rings: In order.
            cost: Points lost per metre from the next ring's centre.
        """
        self._rings, self._cost = rings, cost
        self._before: Vec3 | None = None
        self.passed = 0
        self.closest = inf
        """Closest distance to the next ring's centre since the last ring, m."""

    def move_to(self, position: Vec3) -> None:
        """Continue the flight to the next position."""
        if self._before is not None:
            while self.passed < len(self._rings) and self._rings[self.passed].is_passed(
                self._before, position
            ):
                self.passed, self.closest = self.passed + 1, inf
        self._before = position
        if self.passed < len(self._rings):
            self.closest = min(self.closest, dist(position, self._rings[self.passed].centre))

    @property
    def score(self) -> float:
        """10 points for each ring, and up to 10 for coming close to the next."""
        done = self.passed == len(self._rings)
        close = 0.0 if done else max(0.0, CLOSE - self._cost * self.closest)
        return EACH * self.passed + close
