"""The MuJoCo engine."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from types import ModuleType

import mujoco

from agentflow.env.constants import Constants, constants
from agentflow.env.physics.engine import EngineIdentity
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco import MUJOCO
from agentflow.env.physics.mujoco.world import MuJoCoWorld, Structure
from agentflow.env.scene import Scene

PATIENCE = 50
"""Loading compiled code takes as long as it saves in so many rollouts."""


class MuJoCoEngine:
    """An `engine.Engine`; see there for its members."""

    def __init__(self, physics: Constants | None = None) -> None:
        self.physics = physics or constants()
        self.patience = PATIENCE
        """How many more worlds take steps one by one, which changes no bit."""
        self.kept: list[Structure] = []
        """For further worlds with the same machine, which change no bit either."""
        # MuJoCo would write warnings of machines that explode to a file in the working directory;
        # the speeds and loads of such a machine show the same.
        mujoco.set_mju_user_warning(_ignore)

    @property
    def identity(self) -> EngineIdentity:
        return MUJOCO.identity

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> MuJoCoWorld:
        compiled = None if self.patience else compiled_steps()
        self.patience -= bool(self.patience)
        return MuJoCoWorld(self.physics, assembly, scene, rate, self.kept, compiled)

    def close(self) -> None:
        self.kept.clear()


@cache
def compiled_steps() -> ModuleType | None:
    """The module `ahead`; None without the extra `speed`, or where it cannot keep what it
    compiles."""
    try:
        return import_module("agentflow.env.physics.mujoco.ahead")
    except (ImportError, RuntimeError):  # without numba, or a folder that it may write to
        return None


def _ignore(warning: str) -> None:
    del warning
