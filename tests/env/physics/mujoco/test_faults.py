"""A machine that explodes in MuJoCo ends its own rollout and no other, and processes agree."""

from __future__ import annotations

import os
import sys
from itertools import islice
from math import inf, nan

import pytest

from agentflow.env.physics.model import Assembly
from agentflow.env.physics.mujoco.engine import MuJoCoEngine
from agentflow.env.physics.mujoco.world import MuJoCoWorld
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from benchmarks.stress import cases, faults
from tests.env.machines import CAR
from tests.processes import run_python

SHORT = get_task("movement", {"window": 1, "blocks.max": 0}, "mujoco")


class StruckWorld(MuJoCoWorld):
    """Gives the first body a velocity in the 100th step."""

    velocity = 0.0
    steps = 0

    def step(self, divisions: int = 1, *_ahead: object) -> None:
        self.steps += 1
        if self.steps == 100:
            self.now.built.data.qvel[2] = self.velocity
        super().step(divisions)


class Struck(MuJoCoEngine):
    """Its first world is struck."""

    velocity: float | None = None

    def build(self, assembly: Assembly, scene: Scene, rate: float) -> MuJoCoWorld:
        if self.velocity is None:
            return super().build(assembly, scene, rate)
        world = StruckWorld(self.physics, assembly, scene, rate, self.kept)
        world.velocity, self.velocity = self.velocity, None
        return world


@pytest.mark.parametrize("velocity", [nan, inf, 1e4, 1e200])
def test_a_body_that_leaves_the_finite_world_ends_its_rollout_only(velocity: float) -> None:
    engine = Struck()
    before = simulate(CAR, SHORT, engine=engine)
    engine.velocity = velocity
    rollout = simulate(CAR, SHORT, engine=engine)
    assert (rollout.status, rollout.score) == ("diverged", 0.0)
    assert faults(rollout) == []
    assert simulate(CAR, SHORT, engine=engine).digest == before.digest


COUNT = 20
SCRIPT = """
from tests.env.physics.mujoco.test_faults import digests
print(*digests(backwards=True))
"""


def digests(backwards: bool) -> list[str | None]:
    """Of random machines, in this order or the opposite one."""
    chosen = list(islice(cases(COUNT, 2, "mujoco"), COUNT))
    return [
        simulate(tree, task).digest for _, task, tree in (chosen[::-1] if backwards else chosen)
    ]


@pytest.mark.slow
def test_random_machines_repeat_bit_by_bit_in_another_process_and_order() -> None:
    path = os.pathsep.join(sys.path)
    done = run_python("-c", SCRIPT, PYTHONPATH=path, PYTHONHASHSEED="7")
    assert done.stdout.split()[::-1] == digests(backwards=False)
