"""What only PyBullet can be asked: its constraints, and bodies that are given a speed."""

from __future__ import annotations

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.model import Devices
from agentflow.env.physics.pybullet.engine import PyBulletEngine
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.scene import Scene, Thing
from agentflow.machine.geometry.placement import place
from tests.env.machines import machine
from tests.env.physics.rig import RATE

ROOT = (0, -1, -1)
GRAVITY = 32.81


def test_loops_are_bound_once_after_every_split() -> None:
    """Splits far from a loop leave its body standing; its constraints are made anew, not added."""
    engine = PyBulletEngine()
    beam = (ROOT, (15, 0, 2), (15, 1, 0), (15, 2, 0))
    arms = ((5, 0, 4), (5, 3, 3), (15, 4, 0), (15, 5, 0), (19, 6, 1), (15, 8, 0))
    tree = machine(*beam, *arms, (15, 0, 0), (15, 10, 0))
    assembly = assemble(tree, place(tree), constants())
    world = engine.build(assembly, Scene(), RATE)
    before = pybullet.getNumConstraints(engine.client)
    assert before == 1
    world.split([i for i, joint in enumerate(assembly.joints) if joint.block == 11])
    assert pybullet.getNumConstraints(engine.client) == before
    assert assembly.devices == Devices()
    engine.close()


@pytest.mark.parametrize("friction", [0.8, 0.2])
def test_the_ground_is_as_rough_as_the_constants_say(friction: float) -> None:
    """A box that slides to a stop: the way is v squared over twice friction times gravity."""
    physics = constants().changed({"friction": friction})
    engine = PyBulletEngine(physics)
    tree = machine(ROOT)
    slab = Thing("slab", "box", (2.0, 0.2, 2.0), (0.0, 0.1, 20.0), mass=1.0)
    world = engine.build(
        assemble(tree, place(tree), physics), Scene((slab,), (0.0, 0.0, 0.0)), RATE
    )
    for _ in range(60):
        world.step()
    uid = world.things["slab"]
    pybullet.resetBaseVelocity(uid, (4.0, 0.0, 0.0), physicsClientId=engine.client)
    start = world.centre("slab")[0]
    for _ in range(180):
        world.step()
    way = world.centre("slab")[0] - start
    engine.close()
    assert way == pytest.approx(16.0 / (2 * friction * GRAVITY), rel=0.1)
