"""What only PyBullet can be asked: its constraints, and bodies that are given a speed."""

from __future__ import annotations

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.model import Assembly, Joint, Part
from agentflow.env.physics.pybullet.engine import PyBulletEngine
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import IDENTITY
from tests.env.machines import machine
from tests.env.physics.rig import RATE
from tests.env.physics.test_loops import FREE, linkage

ROOT = (0, -1, -1)
GRAVITY = 32.81


def test_loops_are_bound_once_after_every_split() -> None:
    """Splits far from a loop leave its body standing; its constraints are made anew, not added."""
    engine = PyBulletEngine()
    bars = linkage((FREE,) * 4, range(4))
    aside = (8.0, 1.0, 0.0)
    parts = (*bars.parts, Part(4, aside, 1.0, (1.0,) * 3))
    joints = (*bars.joints, Joint(4, 0, 0, 4, pivot=aside))
    centres, blocks = (*bars.centres, aside), (*bars.blocks, (4,))
    assembly = Assembly(parts, joints, blocks, centres, centres, (IDENTITY,) * len(parts))
    world = engine.build(assembly, Scene(), RATE)
    before = pybullet.getNumConstraints(engine.client)
    assert before == 1
    world.split([len(joints) - 1])
    assert pybullet.getNumConstraints(engine.client) == before
    engine.close()


@pytest.mark.parametrize("friction", [0.8, 0.2])
def test_the_ground_is_as_rough_as_the_constants_say(friction: float) -> None:
    """A box that slides to a stop: the way is v squared over twice friction times gravity."""
    physics = constants().changed({"friction": friction})
    engine = PyBulletEngine(physics)
    tree = machine(ROOT)
    slab = SceneObject("slab", "box", (2.0, 0.2, 2.0), (0.0, 0.1, 20.0), mass=1.0)
    world = engine.build(
        assemble(tree, place(tree), physics), Scene((slab,), (0.0, 0.0, 0.0)), RATE
    )
    for _ in range(60):
        world.step()
    uid = world.objects["slab"]
    pybullet.resetBaseVelocity(uid, (4.0, 0.0, 0.0), physicsClientId=engine.client)
    start = world.centre("slab")[0]
    for _ in range(180):
        world.step()
    way = world.centre("slab")[0] - start
    engine.close()
    assert way == pytest.approx(16.0 / (2 * friction * GRAVITY), rel=0.1)
