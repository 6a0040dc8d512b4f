"""Scoring of gearing: how fast the targets turn relative to the plate, and for how long."""

from math import atan2, pi
from typing import Literal

from agentflow.env.feedback.text import number
from agentflow.env.rollout import Trace, Verdict
from agentflow.env.tasks.base import ROUNDING, WorldView
from agentflow.machine.geometry.vectors import Quat

SOURCE = 1
"""Block id of the driven cog; the targets' ids follow."""
MIN_SPEED = 0.5
"""Speed that the targets must reach, rad/s."""
HOLD = 1.0
"""Time for which the targets must keep that speed, s."""
INTERVAL = 0.1
"""Time over which speeds are averaged, s."""
Sense = Literal["with", "against"]
"""Required direction of a target: with the source or against it."""


class GearingReferee:
    """Measures the speeds of source and targets relative to the plate, every 0.1 s."""

    def __init__(self, senses: tuple[Sense, ...]) -> None:
        self._senses = senses
        self._angles: list[float] = []
        self._since = self._held = self._best = 0.0
        self._fastest = [0.0 for _ in senses]

    def start(self, world: WorldView) -> None:
        """Record the initial angles."""
        self._angles = self._read_angles(world)

    def watch(self, world: WorldView) -> None:
        """Update speeds and times every 0.1 s."""
        time = world.time - self._since
        if time < INTERVAL - ROUNDING:
            return
        now = self._read_angles(world)
        source, *targets = (
            ((b - a + pi) % (2 * pi) - pi) / time for a, b in zip(self._angles, now, strict=True)
        )
        turning = (source > 0) - (source < 0)
        speeds = [
            turning * (speed if sense == "with" else -speed)
            for speed, sense in zip(targets, self._senses, strict=True)
        ]
        self._held = self._held + time if min(speeds) >= MIN_SPEED else 0.0
        self._best = max(self._best, self._held)
        self._fastest = [max(pair) for pair in zip(self._fastest, speeds, strict=True)]
        self._angles, self._since = now, world.time

    def _read_angles(self, world: WorldView) -> list[float]:
        """Angles of source and targets about y relative to the plate, rad."""
        cogs = range(SOURCE, SOURCE + 1 + len(self._senses))
        plate = _heading(world.rotation(0))
        return [_heading(world.rotation(cog)) - plate for cog in cogs]

    def verdict(self, trace: Trace) -> Verdict:  # noqa: ARG002
        """1 or 0; terms: seconds held, greatest speed of each target as required (rad/s)."""
        success = self._best >= HOLD - ROUNDING
        terms: dict[str, float | bool | str | None] = {"success": success, "held": self._best}
        for index, speed in enumerate(self._fastest, start=1):
            terms[f"speed_{index}"] = speed
        slow = min(self._fastest)
        lasting = f"for {number(self._best, 1)} s"
        terms["result"] = (
            f"turning as required {lasting}"
            if success
            else f"not turning as required: at most {number(slow)} rad/s, fast enough {lasting}"
        )
        return Verdict(float(success), terms)


def _heading(rotation: Quat) -> float:
    """Angle about y of a body's Right axis, rad."""
    x, y, z, w = rotation
    return atan2(2 * (x * z - y * w), 1 - 2 * (y * y + z * z))
