"""The PyBullet engine: one client, which holds one world at a time."""

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import EngineIdentity
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet import PYBULLET
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.world import PyBulletWorld
from agentflow.env.scene import Scene


class PyBulletEngine:
    """An `engine.Engine`; see there for its members."""

    def __init__(self, physics: Constants | None = None) -> None:
        self.physics = physics or constants()
        self.client: int = pybullet.connect(pybullet.DIRECT)
        self._open = True
        # Every body is also loaded into this renderer, which takes half the time of a build.
        # Loading the plugin again only returns its number.
        renderer = pybullet.loadPlugin("tinyRendererPlugin", physicsClientId=self.client)
        pybullet.unloadPlugin(renderer, physicsClientId=self.client)

    @property
    def identity(self) -> EngineIdentity:
        return PYBULLET.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> PyBulletWorld:
        return PyBulletWorld(self.client, self.physics, assembly, scene, rate)

    def close(self) -> None:
        if self._open:
            pybullet.disconnect(self.client)
            self._open = False
