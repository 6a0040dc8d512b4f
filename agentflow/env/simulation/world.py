"""The view of a running world that referees get."""

from __future__ import annotations

from agentflow.env.physics.engine import World
from agentflow.env.tasks.base import Body
from agentflow.machine.geometry.vectors import Quat, Vec3


class RefereeView:
    """A `tasks.base.WorldView`: where everything is and what touches what, and the time."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.time = 0.0
        """Seconds since t = 0."""

    def centre(self, body: Body) -> Vec3:
        return self._world.centre(body)

    def origin(self, block: int) -> Vec3:
        return self._world.origin(block)

    def rotation(self, body: Body) -> Quat:
        return self._world.rotation(body)

    def touching(self, body: Body) -> frozenset[Body]:
        return self._world.touching(body)
