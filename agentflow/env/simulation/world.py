"""Owns the view of a running rollout that referees get."""

from __future__ import annotations

from agentflow.env.physics.engine import Engine
from agentflow.env.scene import Quat, Vec3
from agentflow.env.tasks.base import Body


class EngineWorld:
    """A `tasks.base.World` on top of an engine."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self.time = 0.0
        """Seconds since t = 0."""

    def centre(self, body: Body) -> Vec3:
        """Centre of a block or a thing, m."""
        return self._engine.centre(body)

    def origin(self, block: int) -> Vec3:
        """Building point of a block, m."""
        return self._engine.origin(block)

    def rotation(self, body: Body) -> Quat:
        """Orientation of a block or a thing."""
        return self._engine.rotation(body)

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or thing is in contact with in this step."""
        return self._engine.touching(body)
