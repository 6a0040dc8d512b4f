"""A platform for the machine to start on."""

from math import cos, radians, sin

from agentflow.env.scene import SceneObject, Start
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD
from agentflow.env.tasks.knobs import knob

SIDE = 18.0
"""Length and width, m; slightly larger than the building volume."""
THICK = 0.4


class Platform(Parameters):
    """A flat or tilted platform under the machine."""

    height: float = knob(
        0,
        0,
        10,
        "m",
        "height of the platform's lowest edge; no platform if height and angle are both 0",
    )
    angle: float = knob(0, -30, 30, "degrees", "tilt; positive raises the z+ end")

    @property
    def middle(self) -> float:
        """Height of the middle of its top, m."""
        return self.height + SIDE / 2 * sin(radians(abs(self.angle)))

    @property
    def start(self) -> Start:
        """Where the machine starts."""
        return Start(height=self.middle, pitch=self.angle) if self.present else Start()

    @property
    def present(self) -> bool:
        """Whether the level has a platform."""
        return bool(self.height or self.angle)

    def objects(self) -> tuple[SceneObject, ...]:
        """The platform; () without one."""
        if not self.present:
            return ()
        tilt = radians(self.angle)
        place = (0.0, self.middle - THICK / 2 * cos(tilt), THICK / 2 * sin(tilt))
        return (
            SceneObject(
                "platform", "box", (SIDE, THICK, SIDE), place, self.start.rotation, color=WOOD
            ),
        )
