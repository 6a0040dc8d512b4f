"""A body that is struck out of the finite world ends its own rollout only."""

from __future__ import annotations

from math import inf, nan

import pytest

from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.engine import PyBulletEngine
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.pybullet.world import PyBulletWorld
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from benchmarks.stress import faults
from tests.env.machines import CAR
from tests.env.test_bounds import SHORT, short


class StruckWorld(PyBulletWorld):
    """Gives the first body a velocity in the 100th step."""

    velocity = 0.0
    steps = 0

    def step(self, divisions: int = 1, *_ahead: object) -> None:
        self.steps += 1
        if self.steps == 100:
            uid = self.now.built.pieces[0].uid
            pybullet.resetBaseVelocity(uid, [0.0, self.velocity, 0.0], physicsClientId=self.client)
        super().step(divisions)


class Struck(PyBulletEngine):
    """Its first world is struck."""

    velocity: float | None = None

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> PyBulletWorld:
        if self.velocity is None:
            return super().build(assembly, scene, rate)
        world = StruckWorld(self.client, self.physics, assembly, scene, rate)
        world.velocity, self.velocity = self.velocity, None
        return world


@pytest.mark.parametrize("velocity", [nan, inf, 1e4, 1e200])
def test_a_body_that_leaves_the_finite_world_ends_its_rollout_only(velocity: float) -> None:
    engine = Struck()
    engine.velocity = velocity
    rollout = simulate(CAR, SHORT, engine=engine)
    assert (rollout.status, rollout.score) == ("diverged", 0.0)
    assert faults(rollout) == []
    again = simulate(CAR, SHORT, engine=engine)
    assert again.digest == short().digest
    engine.close()
