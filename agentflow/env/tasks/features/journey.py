"""A way to a target, or there and back, and how much of it something has come."""

from math import hypot

import numpy as np

from agentflow.env.rollout import Trace
from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.knobs import knob

LEAST = 4.0
"""How far every block must get from where it was, m: a crane that stays there carries nothing."""
MARK = (0.2, 0.6, 0.3, 1.0)
Point = tuple[float, float]
"""x and z, m."""


class Target(Parameters):
    """Where to go, from where what is to be moved is at t = 0."""

    right: float = knob(10, -30, 30, "m", "distance of the target along x+")
    ahead: float = knob(10, 5, 30, "m", "distance of the target along z+")
    reach: float = knob(1, 0.1, 5, "m", "greatest distance that counts as arrived")
    back: int = knob(0, 0, 1, "", "1: from the target back to the start")

    @property
    def length(self) -> float:
        """Distance from the start, m."""
        return hypot(self.right, self.ahead)


class Journey:
    """Follows something on its way; only horizontal distances count."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self.deviation = 0.0
        """Greatest distance from the straight line, m."""
        self.turned: float | None = None
        """When it reached the target of a way there and back, s."""
        self.arrived: float | None = None
        """Since when it is at the end of its way, s."""
        self._origin: Point = (0.0, 0.0)
        self._here: Point = (0.0, 0.0)
        self._time = 0.0

    def start(self, point: Point) -> None:
        """Note where it is at t = 0."""
        self._origin = self._here = point

    def move(self, point: Point, time: float) -> None:
        """Note where it is at this time (s)."""
        self._here, self._time = point, time
        self.deviation = max(self.deviation, self._aside(*point))
        if self.left > self.target.reach:
            self.arrived = None
        elif self.target.back and self.turned is None:
            self.turned = time
        elif self.arrived is None:
            self.arrived = time

    @property
    def left(self) -> float:
        """Distance from the end of this part of the way, m."""
        (x, z), (x0, z0), target = self._here, self._origin, self.target
        if self.turned is not None:
            return hypot(x - x0, z - z0)
        return hypot(x - x0 - target.right, z - z0 - target.ahead)

    def _aside(self, x: float, z: float) -> float:
        """Distance from the line through start and target, m."""
        (x0, z0), target = self._origin, self.target
        return abs((x - x0) * target.ahead - (z - z0) * target.right) / target.length

    def distance(self, trace: Trace) -> tuple[float, bool]:
        """How much of the way is left, as scored (m), and whether some block stayed behind.

        A part of the way on which a block stayed where it was does not count; of a way there and
        back, half of what is left counts.
        """
        length, turned = self.target.length, self.turned
        first = not turned or _least_moved(trace, 0.0, turned) > LEAST
        if turned is not None and not first:
            return length, True
        stayed = _least_moved(trace, turned or 0.0, self._time) <= LEAST
        left = length if stayed else self.left
        if not self.target.back:
            return left, stayed
        return (left + (length if turned is None else 0.0)) / 2, stayed


def _least_moved(trace: Trace, begin: float, end: float) -> float:
    """Least horizontal distance of any block between its places at two times (s), m."""
    last = len(trace.times) - 1
    a, b = (min(last, int(np.searchsorted(trace.times, time))) for time in (begin, end))
    way = trace.centre[b] - trace.centre[a]
    return float(np.hypot(way[:, 0], way[:, 2]).min())


def target_mark(target: Target) -> SceneObject:
    """A disc that shows the target in plans; it lies under the ground, where nothing is."""
    size, place = (2 * target.reach, 0.1, 2 * target.reach), (target.right, -0.1, target.ahead)
    return SceneObject("target", "cylinder", size, place, color=MARK)
