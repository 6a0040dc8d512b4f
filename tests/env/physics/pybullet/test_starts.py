"""Steps can be divided, and nothing else in a rollout notices."""

from __future__ import annotations

from collections.abc import Mapping

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


def started(rate: float) -> tuple[Mapping[str, Array], Array]:
    """State and reactions 0.1 s after the motors were switched on, in steps at 480 Hz."""
    engine = PyBulletEngine()
    assembly = assemble(BALLASTED, place(BALLASTED), constants())
    world = engine.build(assembly, Scene(), rate)
    world.switch("motors", 1.0)
    for _ in range(48):
        world.step(round(FINE / rate))
    state, reactions = vars(world.state()), world.reactions.copy()
    engine.close()
    return state, reactions


@pytest.mark.parametrize("rate", [60.0, 120.0, 240.0])
def test_parts_of_steps_are_steps_at_a_higher_rate(rate: float) -> None:
    divided, loads = started(rate)
    whole, expected = started(FINE)
    assert all((divided[name] == whole[name]).all() for name in whole)
    assert (loads == expected).all()


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
def test_a_motor_is_as_strong_in_parts_of_steps(rate: float) -> None:
    engine = PyBulletEngine(weightless())
    world = engine.build(flywheel(Drive(50.0, 200.0)), Scene(), rate)
    world.switch("motors", 1.0)
    speeds = []
    for divisions in (4, 1, 2, 1):
        for _ in range(round(0.1 * rate) * divisions):
            world.step(divisions)
        speeds.append(world.state().angular_velocity[1, 1])
    assert speeds == pytest.approx([0.2, 0.4, 0.6, 0.8], rel=1e-3)
    engine.close()


def test_looking_more_often_changes_nothing() -> None:
    task = get_task("throwing", {"window": 1})
    rare, often = (simulate(BALLASTED, task, interval=each).trace for each in (0.2, 1 / 120))
    assert rare is not None
    assert often is not None
    assert (often.position[::24] == rare.even.position).all()
    assert (often.velocity[::24] == rare.even.velocity).all()
