"""The engine, which lets the default one work."""

from __future__ import annotations

from agentflow.env.physics.tick import TICK

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Engine, EngineIdentity, World
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.model import Assembly
from agentflow.env.scene import Scene


class TickEngine:
    """The default engine, recorded as another."""

    def __init__(self, physics: Constants | None) -> None:
        self._engine: Engine = default_engine().start(physics)

    @property
    def identity(self) -> EngineIdentity:
        return TICK.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:
        return self._engine.build(assembly, scene, rate)

    def close(self) -> None:
        self._engine.close()
