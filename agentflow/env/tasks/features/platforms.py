"""Owns the platform that a machine can stand on instead of the ground."""

from __future__ import annotations

from math import cos, radians, sin

from agentflow.env.scene import Start, Thing
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD
from agentflow.env.tasks.knobs import knob

SIDE = 18.0
"""Length and width, m: what the building volume needs, and a little more."""
THICK = 0.4


class Platform(Parameters):
    """Where the machine stands."""

    height: float = knob(0, 0, 10, "m", "height of its lowest edge; 0 without angle removes it")
    angle: float = knob(0, -30, 30, "degrees", "by which its z+ end is raised")

    @property
    def middle(self) -> float:
        """Height of the middle of its upper side, m."""
        return self.height + SIDE / 2 * sin(radians(abs(self.angle)))

    @property
    def start(self) -> Start:
        """How the machine is put on it."""
        return Start(height=self.middle, pitch=self.angle) if self.present else Start()

    @property
    def present(self) -> bool:
        """Whether there is one."""
        return bool(self.height or self.angle)

    def things(self) -> tuple[Thing, ...]:
        """A plate under the machine."""
        if not self.present:
            return ()
        tilt = radians(self.angle)
        place = (0.0, self.middle - THICK / 2 * cos(tilt), THICK / 2 * sin(tilt))
        return (
            Thing("platform", "box", (SIDE, THICK, SIDE), place, self.start.rotation, color=WOOD),
        )

    def sentences(self) -> tuple[str, ...]:
        """What designers are told; () without one."""
        if not self.present:
            return ()
        flat = f"It stands not on the ground but on a platform, {SIDE:g} m long and wide, "
        if not self.angle:
            return (f"{flat}{self.height:g} m above the ground.",)
        end = "z+" if self.angle > 0 else "z-"
        return (
            f"{flat}that is tilted by {abs(self.angle):g} degrees, its {end} end up; its lowest "
            f"edge is {self.height:g} m above the ground, and the machine is tilted with it.",
        )
