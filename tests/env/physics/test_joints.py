"""Every moving joint on all six facings: its axis, its limits, its motor, its friction."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine
from agentflow.env.rotations import rotate
from agentflow.env.scene import Scene
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import FACINGS, RATE, Rig, face_towards

SIX = pytest.mark.parametrize(
    "face",
    [pytest.param(face, marks=() if face in (0, 3, 4) else pytest.mark.slow) for face in range(6)],
    ids=FACINGS,
)
"""Each face; one along each axis in the fast part."""
ROOT = (0, -1, -1)
LOG = 63


def blow(*pushes: tuple[float, Vec3]) -> list[float]:
    """The sum of winds, each a speed along a direction."""
    return [float(x) for x in sum(speed * np.array(way) for speed, way in pushes)]


def mount(calm: Engine, tree: Machine, *pushes: tuple[float, str]) -> Rig:
    """A rig whose wind blows along axes of block 1 at rest."""
    block = Rig(calm, tree).blocks[1]
    ways = [(speed, tuple(map(float, getattr(block, axis)))) for speed, axis in pushes]
    return Rig(calm, tree, wind=blow(*ways) if ways else (0, 0, 0))  # type: ignore[arg-type]


@SIX
@pytest.mark.parametrize("way", [1.0, -1.0], ids=["up", "down"])
def test_a_hinge_swings_about_its_right_to_90_degrees(calm: Engine, face: int, way: float) -> None:
    """The wind blows up (or down) and back, so that nothing but the stop holds it at 90."""
    rig = mount(calm, machine(ROOT, (5, 0, face), (1, 1, 0)), (way * 9.0, "up"), (-6.0, "front"))
    right = rig.blocks[1].right
    rig.run(0.1)
    assert 0.01 < -way * rig.angle(2, right) < 1.5
    rig.run(1.5)
    assert rig.angle(2, right) == pytest.approx(-way * pi / 2, abs=0.02)
    assert rig.turned(2, rig.blocks[2].front) == pytest.approx(
        way * np.array(rig.blocks[1].up), abs=0.02
    )


@SIX
def test_a_steering_hinge_swings_to_its_left_at_3_radians_per_second(
    calm: Engine, face: int
) -> None:
    rig = mount(calm, machine(ROOT, (28, 0, face), (LOG, 1, 0)))
    up = rig.blocks[1].up
    rig.run(0.2)
    assert rig.angle(2, up) == pytest.approx(0.0, abs=1e-6)
    rig.world.switch("steering_hinges", 1)
    rig.run(0.2)
    before = rig.angle(2, up)
    rig.run(0.2)
    assert rig.angle(2, up) - before == pytest.approx(-0.6, abs=0.01)
    assert rig.spin(2, up) == pytest.approx(-3.0, rel=0.01)
    rig.run(1.0)
    assert rig.angle(2, up) == pytest.approx(-pi / 2, abs=0.01)
    left = -np.array(rig.blocks[1].right)
    assert rig.turned(2, rig.blocks[2].front) == pytest.approx(left, abs=0.01)
    rig.world.switch("steering_hinges", -1)
    rig.run(1.5)
    assert rig.angle(2, up) == pytest.approx(pi / 2, abs=0.01)


@SIX
@pytest.mark.parametrize("kind", [13, 22])
def test_motor_joints_turn_clockwise_seen_from_their_front(
    calm: Engine, kind: int, face: int
) -> None:
    """Clockwise seen from outside is a positive turn about Front: y+ takes z+ to x+."""
    rig = mount(calm, machine(ROOT, (kind, 0, face), (LOG, 1, 0)))
    front, speed = rig.blocks[1].front, constants().of("motor_speed", kind)
    rig.run(0.2)
    assert rig.spin(2, front) == pytest.approx(0.0, abs=1e-6)
    rig.world.switch("motors", 1)
    rig.run(0.3)
    assert rig.spin(2, front) == pytest.approx(speed, rel=0.001)
    rig.run(1.0)
    rig.angle(2, front)
    assert rig.spin(1, front) == pytest.approx(speed, rel=0.001)
    rig.world.switch("motors", -1)
    rig.run(0.3)
    assert rig.spin(2, front) == pytest.approx(-speed, rel=0.001)
    rig.world.switch("motors", 0)
    rig.run(0.3)
    assert rig.spin(2, front) == pytest.approx(0.0, abs=1e-3)


def test_spinning_up_takes_what_the_torque_gives(calm: Engine) -> None:
    tree = machine(ROOT, (13, 0, 4))
    rig = mount(calm, machine(ROOT, (13, 0, 4), (LOG, 1, face_towards(tree, 1, "x+"))))
    joint, log = rig.assembly.parts[1:]
    arm = log.centre[0] - joint.centre[0]
    moment = joint.inertia[1] + log.inertia[1] + log.mass * arm * arm
    rig.world.switch("motors", 1)
    rig.world.step()
    gained = constants().of("motor_torque", 13) / moment / RATE
    assert rig.spin(2, (0.0, 1.0, 0.0)) == pytest.approx(gained, rel=1e-3)


@SIX
def test_a_universal_joint_turns_about_its_front_without_limit(calm: Engine, face: int) -> None:
    """An arm on its Left trails down the wind: to Down, and over it to Right."""
    tree = machine(ROOT, (19, 0, face), (LOG, 1, 1))
    rig = mount(calm, tree, (-12.0, "up"))
    front, right, up = (
        np.array(axis) for axis in (rig.blocks[1].front, rig.blocks[1].right, rig.blocks[1].up)
    )
    assert rig.blocks[2].front == pytest.approx(-right)
    rig.run(2.0)
    rig.angle(2, tuple(front))
    assert rig.turned(2, rig.blocks[2].front) == pytest.approx(-up, abs=0.05)
    rig = mount(calm, tree, (12.0, "right"), (-3.0, "up"))
    rig.run(2.0)
    assert abs(rig.angle(2, tuple(front))) > 2.6
    assert np.dot(rig.turned(2, rig.blocks[2].front), right) > 0.9


@SIX
@pytest.mark.parametrize("kind", [44, 76])
def test_ball_joints_turn_every_way(calm: Engine, kind: int, face: int) -> None:
    for pushes in ([(9.0, "up"), (9.0, "right")], [(-9.0, "up"), (9.0, "right")]):
        rig = mount(calm, machine(ROOT, (kind, 0, face), (LOG, 1, 0)), *pushes)
        block = rig.blocks[1]
        rig.run(2.0)
        wind = blow(*((speed, getattr(block, axis)) for speed, axis in pushes))
        trailing = np.array(wind) / np.linalg.norm(wind)
        assert rig.turned(2, rig.blocks[2].front) == pytest.approx(trailing, abs=0.05)
        pivot = rig.world.state().position[1]
        assert pivot == pytest.approx(rig.rest.position[1], abs=0.01)


def swings(friction: float, make_engine: MakeEngine) -> list[float]:
    """Turning angles from below of a log that is let go level, rad, one per swing."""
    engine = make_engine()
    foot = (ROOT, (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3), (LOG, 0, 4), (LOG, 5, 0))
    post = machine(*foot, (19, 6, 6))
    tree = machine(*foot, (19, 6, 6), (LOG, 7, face_towards(post, 7, "z+")))
    physics = constants().changed({"joint_friction.19": friction})
    world = engine.build(assemble(tree, place(tree), physics), Scene(), RATE)
    angles = []
    for _ in range(round(4 * RATE)):
        world.step()
        x, y, z = rotate(np.array(world.rotation(8)), (0.0, 0.0, 1.0))
        assert abs(x) < 0.02
        angles.append(float(np.arctan2(z, -y)))
    rising = np.sign(np.diff(angles))
    return [abs(angles[i + 1]) for i in np.flatnonzero(rising[1:] != rising[:-1])]


def test_a_pendulum_still_swings_and_loses_what_dry_friction_takes(make_engine: MakeEngine) -> None:
    """Friction M takes M pi / (m g d) off the first swing; d = 2 m for the log's kilogram."""
    rough, free = swings(0.6, make_engine), swings(0.0, make_engine)
    assert constants().of("joint_friction", 19) == 0.6
    assert free[1] - rough[1] == pytest.approx(0.6 * pi / (32.81 * 2.0), rel=0.15)
    assert len(rough) >= 4
    assert all(later > 0.8 * before for before, later in pairwise(rough))


@SIX
def test_a_suspension_gives_way_by_load_over_stiffness_and_stops(calm: Engine, face: int) -> None:
    """The wind pushes at the front of the suspension itself and of the ballast on it."""
    value = constants()
    stiffness = value["suspension_stiffness"]
    for speed, expected in (
        (-15.0, -2 * 0.6 * 15.0**2 / stiffness),
        (8.0, 2 * 0.6 * 8.0**2 / stiffness),
        (20.0, value["suspension_high"]),
        (-35.0, value["suspension_low"]),
    ):
        rig = mount(calm, machine(ROOT, (16, 0, face), (35, 1, 0)), (speed, "front"))
        front = np.array(rig.blocks[1].front)
        rig.run(1.5)
        assert float(rig.moved(2) @ front) == pytest.approx(expected, rel=0.01, abs=2e-3)
        assert rig.moved(2) - (rig.moved(2) @ front) * front == pytest.approx([0, 0, 0], abs=1e-3)
        assert rig.world.speeds()[0] < 0.01
