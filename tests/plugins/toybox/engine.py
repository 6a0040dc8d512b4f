"""Two engines: ours under another name, and one whose library is missing."""

from __future__ import annotations

from dataclasses import replace

from agentflow.env.physics.engine import EngineIdentity
from agentflow.env.physics.engines import EngineSpec
from agentflow.env.physics.pybullet import PYBULLET
from agentflow.env.physics.pybullet.engine import PyBulletEngine


class ToyEngine(PyBulletEngine):
    """PyBullet, recorded as another engine."""

    @property
    def identity(self) -> EngineIdentity:
        return TOY.identity


TOY: EngineSpec = replace(PYBULLET, name="toy", factory="toybox.engine:ToyEngine")
ABSENT: EngineSpec = replace(PYBULLET, name="absent", libraries=("no-such-library",))
