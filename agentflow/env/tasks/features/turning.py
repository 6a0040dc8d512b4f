"""Owns how gearing is judged: how fast the targets turn against the plate, and for how long.

Which cogs mesh is machine/gears.py's; what is asked of the targets the family's.
"""

from __future__ import annotations

from math import atan2, pi
from typing import Literal

from agentflow.env.feedback import number
from agentflow.env.rollout import Trace, Verdict
from agentflow.env.scene import Quat
from agentflow.env.tasks.base import World

SOURCE = 1
"""Block id of the driven cog; the targets follow it."""
LEAST = 0.5
"""rad/s (spec 3)."""
HOLD = 1.0
"""Seconds for which the targets must turn so fast (spec 3)."""
GLANCE = 0.1
"""Seconds over which a speed is taken."""
Sense = Literal["with", "against"]
"""How a target is to turn: with the source or against it."""


class GearingReferee:
    """Takes the turns of source and targets against the plate, a tenth of a second at a time."""

    def __init__(self, senses: tuple[Sense, ...]) -> None:
        self._senses = senses
        self._angles: list[float] = []
        self._since = 0.0
        self._held = self._best = 0.0
        self._fastest = [0.0 for _ in senses]

    def start(self, world: World) -> None:
        """Remember how everything stands."""
        self._angles = self._look(world)

    def watch(self, world: World) -> None:
        """Take the speeds whenever a tenth of a second is over."""
        time = world.time - self._since
        if time < GLANCE - 1e-6:
            return
        now = self._look(world)
        source, *turned = (_wrapped(b - a) / time for a, b in zip(self._angles, now, strict=True))
        speeds = [
            _along(source, speed, sense) for speed, sense in zip(turned, self._senses, strict=True)
        ]
        self._held = self._held + time if min(speeds) >= LEAST else 0.0
        self._best = max(self._best, self._held)
        self._fastest = [max(pair) for pair in zip(self._fastest, speeds, strict=True)]
        self._angles, self._since = now, world.time

    def _look(self, world: World) -> list[float]:
        """Turns of source and targets about y, in radians against the plate."""
        cogs = range(SOURCE, SOURCE + 1 + len(self._senses))
        plate = _heading(world.rotation(0))
        return [_heading(world.rotation(cog)) - plate for cog in cogs]

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """1 or 0; terms: seconds held, greatest speed of each target as asked (rad/s)."""
        success = self._best >= HOLD - 1e-6
        terms: dict[str, float | bool | str | None] = {"success": success, "held": self._best}
        for index, speed in enumerate(self._fastest, start=1):
            terms[f"speed_{index}"] = speed
        slow = min(self._fastest)
        lasting = f"for {number(self._best, 1)} s"
        terms["result"] = (
            f"turning as asked {lasting}"
            if success
            else f"not turning as asked: {number(slow)} rad/s at most, fast enough {lasting}"
        )
        return Verdict(float(success), terms)


def _heading(rotation: Quat) -> float:
    """Where a body's own Right points, about y, in radians."""
    x, y, z, w = rotation
    return atan2(2 * (x * z - y * w), 1 - 2 * (y * y + z * z))


def _wrapped(angle: float) -> float:
    """The same turn within half a turn."""
    return (angle + pi) % (2 * pi) - pi


def _along(source: float, speed: float, sense: Sense) -> float:
    """A target's speed in the asked sense; none while the source stands."""
    turning = (source > 0) - (source < 0)
    return turning * (speed if sense == "with" else -speed)
