"""The MuJoCo engine."""

from __future__ import annotations

import mujoco

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import EngineIdentity
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco import MUJOCO
from agentflow.env.physics.mujoco.world import MuJoCoWorld
from agentflow.env.scene import Scene


class MuJoCoEngine:
    """An `engine.Engine`; see there for its members. Worlds are all that it holds."""

    def __init__(self, physics: Constants | None = None) -> None:
        self.physics = physics or constants()
        # MuJoCo would write warnings of machines that explode to a file in the working directory;
        # the speeds and loads of such a machine show the same.
        mujoco.set_mju_user_warning(_ignore)

    @property
    def identity(self) -> EngineIdentity:
        return MUJOCO.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> MuJoCoWorld:
        return MuJoCoWorld(self.physics, assembly, scene, rate)

    def close(self) -> None:
        pass


def _ignore(warning: str) -> None:
    del warning
