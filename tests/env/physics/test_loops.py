"""Joints that close a loop through several parts do all that joints in the tree do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import asin

import numpy as np
import pytest

from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.model import Assembly, Drive, Joint, Part, Shape, Strength
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import IDENTITY
from tests.env.physics.rig import run

X, HEIGHT, LENGTH, WIDTH, RATE, G = (1.0, 0.0, 0.0), 10.0, 2.0, 4.0, 120.0, 32.81
ROCKER, COUPLER = 1.0, 5.0
"""Masses, kg."""
MOMENT = 2 * (ROCKER * (LENGTH / 2) ** 2 + 0.5) + COUPLER * LENGTH**2
"""kg m2 of the linkage at the angle of its rockers, which stand upright at rest."""
FREE, MOTOR = Drive(), Drive(3.0, 40.0)
ORDERS = pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (1, 3, 0, 2), (2, 0, 3, 1)])
"""Of the four joints; earlier ones are preferred in the tree."""


def linkage(drives: Sequence[Drive], order: Sequence[int]) -> Assembly:
    """A four-bar linkage: two equal rockers on a slab, and a coupler that stays level."""
    slab = Shape("box", (20.0, 0.5, 20.0))
    top, middle = HEIGHT + LENGTH, HEIGHT + LENGTH / 2
    parts = (
        Part(0, (0.0, 0.25, 0.0), 2e4, (2e5,) * 3, (slab,)),
        Part(1, (0.0, middle, 0.0), ROCKER, (0.5,) * 3),
        Part(2, (0.0, middle, WIDTH), ROCKER, (0.5,) * 3),
        Part(3, (0.0, top, WIDTH / 2), COUPLER, (5.0,) * 3),
    )
    ends = [(0, 1, HEIGHT, 0.0), (0, 2, HEIGHT, WIDTH), (1, 3, top, 0.0), (2, 3, top, WIDTH)]
    joints = [
        Joint(b, a, a, b, "revolute", (0.0, y, z), X, Strength(7500.0, 7500.0), drive=drive)
        for (a, b, y, z), drive in zip(ends, drives, strict=True)
    ]
    centres = tuple(part.centre for part in parts)
    blocks = ((0,), (1,), (2,), (3,))
    turns = (IDENTITY,) * 4
    return Assembly(parts, tuple(joints[i] for i in order), blocks, centres, centres, turns)


def spin(world: World) -> float:
    return float(world.state().angular_velocity[1, 0])


def angle(world: World) -> float:
    return 2 * asin(float(world.state().rotation[1, 0]))


@ORDERS
@pytest.mark.parametrize(
    ("drives", "torque"),
    [
        ((MOTOR, FREE, FREE, FREE), 40.0),
        ((FREE, FREE, FREE, replace(MOTOR, speed=-3.0)), 40.0),
        ((MOTOR, MOTOR, FREE, FREE), 80.0),
        ((MOTOR, MOTOR, replace(MOTOR, speed=-3.0), replace(MOTOR, speed=-3.0)), 160.0),
        ((MOTOR, replace(MOTOR, speed=-3.0), FREE, FREE), 0.0),
        ((replace(MOTOR, torque=60.0), Drive(friction=20.0), FREE, FREE), 40.0),
    ],
)
def test_motors_and_friction_of_a_linkage_add(
    calm: Engine, drives: Sequence[Drive], torque: float, order: Sequence[int]
) -> None:
    world = calm.build(linkage(drives, order), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 0.3)
    assert spin(world) == pytest.approx(torque * 0.3 / MOMENT, rel=0.01, abs=0.01)
    state = world.state()
    assert np.linalg.norm(state.centre[1] - state.centre[2]) == pytest.approx(WIDTH, abs=1e-3)
    assert state.angular_velocity[3, 0] == pytest.approx(0.0, abs=0.01)


@ORDERS
def test_a_motor_in_a_loop_runs_at_its_speed_and_holds_at_level_0(
    calm: Engine, order: Sequence[int]
) -> None:
    drives = (FREE, replace(MOTOR, torque=400.0), FREE, FREE)
    world = calm.build(linkage(drives, order), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 0.4)
    assert spin(world) == pytest.approx(3.0, rel=0.01)
    world.switch("motors", 0.0)
    run(world, 0.3)
    assert spin(world) == pytest.approx(0.0, abs=0.01)


@ORDERS
def test_a_stop_in_a_loop_stops_the_linkage(engine: Engine, order: Sequence[int]) -> None:
    drives = (MOTOR, Drive(stops=(-0.3, 0.3)), FREE, FREE)
    world = engine.build(linkage(drives, order), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 1.5)
    assert angle(world) == pytest.approx(0.3, abs=0.01)


@ORDERS
def test_the_joints_bear_the_weight(engine: Engine, order: Sequence[int]) -> None:
    drives = (MOTOR, FREE, FREE, FREE)
    world = engine.build(linkage(drives, order), Scene(), RATE)
    run(world, 1.0)
    bears = dict(zip(order, world.reactions[:, 1], strict=True))
    assert bears[0] + bears[1] == pytest.approx((2 * ROCKER + COUPLER) * G, rel=0.01)
    assert bears[2] + bears[3] == pytest.approx(COUPLER * G, rel=0.01)


@ORDERS
@pytest.mark.parametrize("broken", range(4))
def test_a_loop_that_opens_goes_on_without_a_jump(
    calm: Engine, order: Sequence[int], broken: int
) -> None:
    world = calm.build(linkage((MOTOR, MOTOR, FREE, FREE), order), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 0.5)
    before, energy = vars(world.state()), world.momentum()["energy"]
    world.split([order.index(broken)])
    for name, value in vars(world.state()).items():
        assert value == pytest.approx(before[name], abs=1e-4)
    assert world.momentum()["energy"] == pytest.approx(energy, rel=1e-4)
    assert not skeleton(4, linkage((FREE,) * 4, order).joints, [order.index(broken)]).loops


@ORDERS
def test_a_suspension_in_a_loop_springs(engine: Engine, order: Sequence[int]) -> None:
    """A deck on two suspensions whose feet swing: half the weight on each."""
    drive = Drive(stiffness=1500.0, damping=60.0, stops=(-0.6, 0.1))
    whole = linkage((MOTOR, MOTOR, drive, drive), (0, 1, 2, 3))
    sprung = [
        replace(joint, kind="prismatic", axis=(0.0, 1.0, 0.0)) if i > 1 else joint
        for i, joint in enumerate(whole.joints)
    ]
    world = engine.build(replace(whole, joints=tuple(sprung[i] for i in order)), Scene(), RATE)
    run(world, 2.0)
    sag = COUPLER * G / 2 / drive.stiffness
    sunk = HEIGHT + LENGTH - (world.centre(3)[1] - world.centre(0)[1] + 0.25)
    assert sunk == pytest.approx(sag, rel=0.03)
