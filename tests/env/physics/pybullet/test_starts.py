"""Motors start in finer steps, and nothing else in a rollout notices."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.model import Assembly, Drive, Joint, Part
from agentflow.env.physics.pybullet.engine import PyBulletEngine
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import IDENTITY
from tests.env.machines import BALLASTED
from tests.env.physics.rig import weightless

FINE = 480.0


def started(rate: float, steps: int) -> tuple[Mapping[str, Array], Array]:
    """State and mean reactions after so many steps since the motors were switched on."""
    engine = PyBulletEngine()
    assembly = assemble(BALLASTED, place(BALLASTED), constants())
    world = engine.build(assembly, Scene(), rate)
    world.switch("motors", 1.0)
    total = np.zeros_like(world.reactions)
    for _ in range(steps):
        world.step()
        total += world.reactions
    state = vars(world.state())
    engine.close()
    return state, total / steps


@pytest.mark.parametrize(("rate", "steps"), [(60.0, 6), (120.0, 12), (240.0, 24)])
def test_a_start_is_the_same_at_every_rate(rate: float, steps: int) -> None:
    coarse, loads = started(rate, steps)
    fine, expected = started(FINE, 48)
    assert all((coarse[name] == fine[name]).all() for name in fine)
    assert loads == pytest.approx(expected, rel=1e-9, abs=1e-6)


def flywheel(drive: Drive) -> Assembly:
    """A wheel of 100 kg m2 on something so heavy that it does not move."""
    centres = ((0.0, 50.0, 0.0), (0.0, 52.0, 0.0))
    parts = (
        Part(0, centres[0], 1e6, (1e6, 1e6, 1e6)),
        Part(1, centres[1], 10.0, (100.0, 100.0, 100.0)),
    )
    joints = (Joint(1, 0, 0, 1, "revolute", centres[1], (0.0, 1.0, 0.0), drive=drive),)
    return Assembly(parts, joints, ((0,), (1,)), centres, centres, (IDENTITY, IDENTITY))


@pytest.mark.parametrize("rate", [60.0, 120.0, 480.0])
def test_a_motor_is_as_strong_while_it_starts_as_afterwards(rate: float) -> None:
    engine = PyBulletEngine(weightless())
    world = engine.build(flywheel(Drive(50.0, 200.0)), Scene(), rate)
    world.switch("motors", 1.0)
    speeds = []
    for _ in range(4):
        for _ in range(round(0.1 * rate)):
            world.step()
        speeds.append(world.state().angular_velocity[1, 1])
    assert speeds == pytest.approx([0.2, 0.4, 0.6, 0.8], rel=1e-3)
    engine.close()


@pytest.mark.parametrize(("torque", "share"), [(0.0, 1.0), (200.0, 10 / 16)])
def test_only_what_has_a_motor_is_stepped_finely(torque: float, share: float) -> None:
    """One step falls by g / rate squared, four of a quarter each by 1 + 2 + 3 + 4 sixteenths."""
    engine = PyBulletEngine()
    world = engine.build(flywheel(Drive(50.0, torque)), Scene(), 120.0)
    high = world.centre(0)[1]
    world.switch("motors", 1.0)
    world.step()
    assert high - world.centre(0)[1] == pytest.approx(share * 32.81 / 120**2, rel=1e-6)
    engine.close()


def test_looking_more_often_changes_nothing() -> None:
    task = get_task("throwing", {"window": 1})
    rare, often = (simulate(BALLASTED, task, interval=each).trace for each in (0.2, 1 / 120))
    assert rare is not None
    assert often is not None
    assert (often.position[::24] == rare.position).all()
    assert (often.velocity[::24] == rare.velocity).all()
