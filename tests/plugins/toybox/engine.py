"""Two engines: the default one under another name, and one whose library is missing."""

from __future__ import annotations

from dataclasses import replace

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import Engine, EngineIdentity, EngineSpec, World
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.model import Assembly
from agentflow.env.scene import Scene


class ToyEngine:
    """The default engine, recorded as another."""

    def __init__(self, physics: Constants | None) -> None:
        self._engine: Engine = default_engine().start(physics)

    @property
    def identity(self) -> EngineIdentity:
        return TOY.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> World:
        return self._engine.build(assembly, scene, rate)

    def close(self) -> None:
        self._engine.close()


TOY: EngineSpec = replace(default_engine(), name="toy", factory="toybox.engine:ToyEngine")
ABSENT: EngineSpec = replace(TOY, name="absent", libraries=("no-such-library",))
