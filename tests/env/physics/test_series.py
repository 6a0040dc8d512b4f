"""Motors in series, each on the block that another one turns, hold and turn like motors alone."""

from __future__ import annotations

from math import radians

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engine import Engine
from agentflow.env.physics.model import Assembly, Drive, Joint, Part, Shape
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import IDENTITY

X, HEIGHT, REACH, G = (1.0, 0.0, 0.0), 10.0, 2.0, 32.81
ROTATING = Drive(constants().of("motor_speed", 22), constants().of("motor_torque", 22))
LIGHT, INERTIA = 1.0, 0.17
"""Mass, kg, and moments, kg m2, of each block between two motors."""
COUNTS = pytest.mark.parametrize("count", [1, 2, 3, 4])


def stack(count: int, mass: float) -> Assembly:
    """So many motors in one line, the last of which turns an arm, on a slab on the ground."""
    slab = Shape("box", (20.0, 0.5, 20.0))
    parts = [Part(0, (0.0, 0.25, 0.0), 2e4, (2e5,) * 3, (slab,))]
    for i in range(1, count):
        parts.append(Part(i, (float(i), HEIGHT, 0.0), LIGHT, (INERTIA,) * 3))
    parts.append(Part(count, (float(count), HEIGHT, REACH), mass, (mass / 6,) * 3))
    joints = [
        Joint(i + 1, i, i, i + 1, "revolute", (float(i), HEIGHT, 0.0), X, drive=ROTATING)
        for i in range(count)
    ]
    centres = tuple(part.centre for part in parts)
    blocks = tuple((i,) for i in range(len(parts)))
    return Assembly(tuple(parts), tuple(joints), blocks, centres, centres, (IDENTITY,) * len(parts))


@COUNTS
def test_they_hold_what_one_holds(engine: Engine, count: int) -> None:
    """460 N m for two seconds."""
    world = engine.build(stack(count, 460.0 / (G * REACH)), Scene(), 120.0)
    for _ in range(240):
        world.step()
    sunk = HEIGHT - (world.centre(count)[1] - world.centre(0)[1] + 0.25)
    assert sunk == pytest.approx(0.0, abs=radians(0.3) * REACH)


@pytest.mark.parametrize("rate", [60.0, 120.0, 240.0, 480.0])
@COUNTS
def test_each_adds_its_speed_at_every_rate(calm: Engine, count: int, rate: float) -> None:
    """The full torque accelerates the arm until all turn at full speed."""
    mass = 5.0
    world = calm.build(stack(count, mass), Scene(), rate)
    world.switch("motors", 1.0)
    moment = mass * (REACH**2 + 1 / 6)
    for step in range(1, round(0.3 * rate) + 1):
        world.step()
        free = ROTATING.torque / moment * step / rate
        spin = world.state().angular_velocity[count, 0]
        assert spin == pytest.approx(min(free, count * ROTATING.speed), rel=0.03)


def test_a_motor_does_not_creep_before_a_device_is_switched_on(engine: Engine) -> None:
    world = engine.build(stack(1, 460.0 / (G * REACH)), Scene(), 120.0)
    for _ in range(240):
        world.step()
    sunk = HEIGHT - (world.centre(1)[1] - world.centre(0)[1] + 0.25)
    assert sunk == pytest.approx(0.0, abs=5e-5)


@COUNTS
def test_motors_that_are_switched_off_brake_and_do_not_turn_back(calm: Engine, count: int) -> None:
    world = calm.build(stack(count, 5.0), Scene(), 120.0)
    spins = []
    for level in (1.0, 0.0):
        world.switch("motors", level)
        for _ in range(60):
            world.step()
            spins.append(float(world.state().angular_velocity[count, 0]))
    assert max(spins) == pytest.approx(count * ROTATING.speed, rel=0.03)
    assert min(spins) > -0.05
    assert spins[-1] == pytest.approx(0.0, abs=0.05)
