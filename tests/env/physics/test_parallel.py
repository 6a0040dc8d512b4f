"""Joints side by side between the same two rigid parts of a machine act together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.model import (
    Assembly,
    CogMesh,
    Devices,
    Drive,
    Joint,
    JointKind,
    Part,
    Shape,
    Strength,
)
from agentflow.env.physics.structure.drives import Motor, MotorCommand, merge_drives
from agentflow.env.physics.structure.load_sharing import load_loops
from agentflow.env.physics.structure.spanning_tree import Link, Parallel, skeleton
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene
from agentflow.machine.geometry.vectors import IDENTITY, Vec3
from agentflow.machine.tree import Machine
from tests.env.machines import Row, machine
from tests.env.physics.rig import RATE, Rig, face_towards, run

STRONG = Strength(7500.0, 7500.0)
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HEIGHT = 10.0
MASS, REACH, G = 5.0, 2.0, 32.81


def block_drive(kind: int, **changes: object) -> Drive:
    """The drive of a block type with a turning joint, from the constants."""
    value = constants()
    drive = Drive(
        value.of("motor_speed", kind),
        value.of("motor_torque", kind),
        friction=value.of("joint_friction", kind),
    )
    return replace(drive, **changes)  # type: ignore[arg-type]


ROTATING, WHEEL = block_drive(22), block_drive(2)
STEERING = block_drive(28, starts="steering_hinges", stops=(-pi / 2, pi / 2))
HINGE = block_drive(5, stops=(-pi / 2, pi / 2))
SUSPENSION = Drive(stiffness=1500.0, damping=60.0, stops=(-0.6, 0.1))


def bank(
    drives: Sequence[Drive],
    mass: float = MASS,
    kind: JointKind = "revolute",
    axis: Vec3 = X,
    signs: Sequence[float] = (),
) -> Assembly:
    """Arms, a metre apart along x, each on a joint of its own to one slab, joined to each other.

    Each has `mass` at `REACH` metres along z from the axis. The sign -1 turns a joint's axis round.
    """
    count = len(drives)
    anchor = Part(0, (0.0, 0.25, 0.0), 2e4, (2e5, 2e5, 2e5), (Shape("box", (20.0, 0.5, 20.0)),))
    arms = [Part(1 + i, (float(i), HEIGHT, REACH), mass, (mass / 6,) * 3) for i in range(count)]
    joints = []
    for i, drive in enumerate(drives):
        sign = signs[i] if signs else 1.0
        way = (sign * axis[0], sign * axis[1], sign * axis[2])
        pivot = (float(i), HEIGHT, 0.0)
        joints.append(Joint(1 + i, 0, 0, 1 + i, kind, pivot, way, STRONG, drive=drive))
    for i in range(1, count):
        middle = (i - 0.5, HEIGHT, REACH)
        joints.append(Joint(i + 1, i, i, i + 1, pivot=middle, strength=STRONG))
    parts = (anchor, *arms)
    centres = tuple(part.centre for part in parts)
    blocks = tuple((i,) for i in range(len(parts)))
    return Assembly(parts, tuple(joints), blocks, centres, centres, (IDENTITY,) * len(parts))


def spin(world: World) -> float:
    return float(world.state().angular_velocity[1, 0])


def height(world: World) -> float:
    """Of block 1, above where the slab, which sinks in a little, stood."""
    return world.centre(1)[1] - world.centre(0)[1] + 0.25


COUNTS = pytest.mark.parametrize("count", [2, 3, 4])
TURNING = pytest.mark.parametrize(
    ("drive", "entry"),
    [(ROTATING, "motors"), (STEERING, "steering_hinges"), (WHEEL, "motors")],
    ids=["rotating block", "steering hinge", "powered wheel"],
)


def spins(engine: Engine, assembly: Assembly, entry: str, seconds: float = 0.4) -> Array:
    """Speed of block 1 after each step since the motors were switched on."""
    world = engine.build(assembly, Scene(), RATE)
    world.switch(entry, 1.0)
    found = []
    for _ in range(round(seconds * RATE)):
        world.step()
        found.append(spin(world))
    return np.array(found)


@COUNTS
@TURNING
def test_motors_side_by_side_move_their_loads_as_one_moves_one(
    calm: Engine, drive: Drive, entry: str, count: int
) -> None:
    single = spins(calm, bank([drive]), entry)
    several = spins(calm, bank([drive] * count), entry)
    assert several == pytest.approx(single, rel=0.03, abs=1e-3)
    assert abs(single[-1]) > 0.5


@COUNTS
def test_their_torques_add(calm: Engine, count: int) -> None:
    """Against one load, and whichever way round their axes are built."""
    heavy = 40.0 * MASS
    drives = [ROTATING, *[replace(ROTATING, speed=-ROTATING.speed)] * (count - 1)]
    signs = [1.0, *[-1.0] * (count - 1)]
    alone = spins(calm, bank([ROTATING], heavy), "motors", 0.1)[-1]
    together = spins(calm, bank(drives, heavy / count, signs=signs), "motors", 0.1)[-1]
    assert together == pytest.approx(count * alone, rel=0.03)


def test_two_hold_at_level_0_what_one_cannot(engine: Engine) -> None:
    """A load of 5/3 of the torque of one motor."""
    load = 5.0 / 3.0 * STEERING.torque / (G * REACH)
    alone = engine.build(bank([STEERING], load), Scene(), RATE)
    run(alone, 1.0)
    assert height(alone) < HEIGHT - 1.0
    pair = engine.build(bank([STEERING] * 2, load / 2), Scene(), RATE)
    run(pair, 1.0)
    assert height(pair) == pytest.approx(HEIGHT, abs=0.01)


@COUNTS
def test_friction_of_free_hinges_adds(engine: Engine, count: int) -> None:
    """Arms fall as one arm on one hinge does, whose friction bears a third of its weight."""
    drive = Drive(friction=MASS * G * REACH / 3.0)
    speeds = []
    for each in (1, count):
        world = engine.build(bank([drive] * each), Scene(), RATE)
        run(world, 0.3)
        speeds.append(spin(world))
    assert speeds[0] == pytest.approx(2.0 / 3.0 * G * 0.3 / REACH, rel=0.1)
    assert speeds[1] == pytest.approx(speeds[0], rel=0.03)


@COUNTS
def test_hinges_stop_where_one_stops(engine: Engine, count: int) -> None:
    """Arms fall from level until the stop holds them straight down; stops of a hinge that is built
    the other way round are met from the other side."""
    world = engine.build(bank([HINGE] * count, 1.0), Scene(), RATE)
    run(world, 3.0)
    assert height(world) == pytest.approx(HEIGHT - REACH, abs=0.02)
    drives = [HINGE, *[replace(HINGE, stops=(-0.5, 1.0))] * (count - 1)]
    for signs, angle in (((1.0,) * count, 1.0), ((1.0,) + (-1.0,) * (count - 1), 0.5)):
        world = engine.build(bank(drives, 1.0, signs=signs), Scene(), RATE)
        run(world, 3.0)
        assert height(world) == pytest.approx(HEIGHT - REACH * np.sin(angle), abs=0.03)


@COUNTS
def test_suspensions_sag_and_stop_as_one(engine: Engine, count: int) -> None:
    """Springs carry their weight together, and where stops come first they rest on them."""
    for lowest, sag in ((-0.6, MASS * G / SUSPENSION.stiffness), (-0.05, 0.05)):
        drive = replace(SUSPENSION, stops=(lowest, 0.1))
        world = engine.build(bank([drive] * count, MASS, "prismatic", Y), Scene(), RATE)
        run(world, 3.0)
        assert height(world) == pytest.approx(HEIGHT - sag, abs=0.03 * sag)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_cogs_mesh_through_a_parallel_joint(calm: Engine, sign: float) -> None:
    """The mesh names the joint that is not in the tree; it lasts when that in the tree breaks."""
    drive = replace(WHEEL, speed=3.0, torque=400.0)
    assembly = bank([drive, Drive(), Drive()], 0.1 * MASS, signs=(1.0, sign, 1.0))
    joints = assembly.joints[:-1]  # the third arm turns on its own
    assert list(skeleton(4, joints).parallel) == [Parallel(1, sign)]
    devices = Devices(cog_meshes=(CogMesh(1, 2, 2.0),))
    world = calm.build(replace(assembly, joints=joints, devices=devices), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 0.5)
    spins = world.state().angular_velocity[1:, 0]
    assert spins == pytest.approx([3.0, 3.0, -1.5 * sign], rel=0.01)
    world.split([0])
    run(world, 0.2)
    first, second, third = world.state().angular_velocity[1:, 0]
    assert first == second == pytest.approx(-2.0 * sign * third, rel=0.01)


# --- different drives ----------------------------------------------------------------------


def test_equal_motors_against_each_other_stand_still(calm: Engine) -> None:
    found = spins(calm, bank([ROTATING, replace(ROTATING, speed=-ROTATING.speed)]), "motors")
    assert np.abs(found).max() < 0.1


def test_the_stronger_of_two_motors_wins_with_the_difference(calm: Engine) -> None:
    moment = 2 * MASS * (REACH**2 + 1 / 6)
    weaker = replace(WHEEL, speed=-WHEEL.speed, torque=10.0)
    found = spins(calm, bank([WHEEL, weaker]), "motors", 0.5)
    assert found[-1] == pytest.approx((WHEEL.torque - 10.0) * 0.5 / moment, rel=0.02)
    final = spins(calm, bank([WHEEL, weaker], 0.2 * MASS), "motors", 3.0)[-1]
    assert final == pytest.approx(10.0, rel=0.01)


def test_motors_of_two_schedule_entries_hold_until_theirs_comes(calm: Engine) -> None:
    """The hinge at level 0 brakes the stronger wheel, then drives with it up to its own speed."""
    wheel, hinge = replace(WHEEL, torque=80.0), replace(WHEEL, torque=40.0, speed=3.0)
    hinge = replace(hinge, starts="steering_hinges")
    moment = 2 * MASS * (REACH**2 + 1 / 6)
    world = calm.build(bank([wheel, hinge]), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 0.5)
    first = spin(world)
    assert first == pytest.approx(40.0 * 0.5 / moment, rel=0.02)
    world.switch("steering_hinges", 1.0)
    run(world, 0.25)
    assert spin(world) - first == pytest.approx(120.0 * 0.25 / moment, rel=0.02)


def test_motors_of_different_targets_are_one_motor_and_a_push() -> None:
    drives = [Drive(8.0, 2800.0), Drive(3.0, 300.0), Drive(friction=0.6)]
    joints = [Joint(1, 0, 0, 1, "revolute", drive=drive) for drive in drives]
    merged = merge_drives(joints, Link(1, 0, 0, False, (Parallel(1, -1.0), Parallel(2, 1.0))))
    assert merged.motors == (
        Motor(8.0, 2800.0, "motors"),
        Motor(-3.0, 300.0, "motors"),
        Motor(0.0, 0.6, "motors"),
    )
    levels = {"motors": 1.0}
    assert merged.command({"motors": 0.0}) == MotorCommand(0.0, 3100.6)
    assert merged.command(levels, -4.0) == MotorCommand(8.0, pytest.approx(3100.6))
    assert merged.command(levels, -1.0) == MotorCommand(8.0, pytest.approx(2800.6), -300.0)
    assert merged.command(levels, 1.0) == MotorCommand(8.0, 2800.0, pytest.approx(-300.6))


# --- loads, breaking -----------------------------------------------------------------------


@COUNTS
def test_joints_side_by_side_share_the_load(engine: Engine, count: int) -> None:
    """Equal ones hold equal parts of the torque, of the weight as lever and strength have it."""
    assembly = bank([STEERING] * count, 2.0)
    world = engine.build(assembly, Scene(), RATE)
    run(world, 0.5)
    plan = skeleton(len(assembly.parts), assembly.joints)
    (loop,) = load_loops(assembly.joints, plan)
    loads = dict(zip(loop.joints.tolist(), loop.share(world.reactions), strict=True))
    own = np.array([loads[i] for i in range(count)])
    assert own[:, 1].sum() == pytest.approx(count * 2.0 * G, rel=0.01)
    assert own[:, 1] == pytest.approx([2.0 * G] * count, rel=0.1)


def tree_joint(assembly: Assembly) -> int:
    """The moving joint that is in the tree."""
    plan = skeleton(len(assembly.parts), assembly.joints)
    return next(link.joint for link in plan.links if assembly.joints[link.joint].kind != "fixed")


@pytest.mark.parametrize("signs", [(1.0, 1.0, 1.0), (1.0, -1.0, 1.0)])
@pytest.mark.parametrize(
    ("drive", "kind", "axis"),
    [(ROTATING, "revolute", X), (SUSPENSION, "prismatic", Y)],
)
def test_another_joint_takes_over_without_a_jump(
    engine: Engine, drive: Drive, kind: JointKind, axis: Vec3, signs: tuple[float, ...]
) -> None:
    drives = [replace(drive, speed=sign * drive.speed, stops=None) for sign in signs]
    assembly = bank(drives, MASS, kind, axis, signs)
    world = engine.build(assembly, Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 1.7)  # more than two turns
    before, energy = vars(world.state()), world.momentum()["energy"]
    world.split([tree_joint(assembly)])
    after = vars(world.state())
    for name, value in before.items():
        assert after[name] == pytest.approx(value, abs=1e-9)
    assert world.momentum()["energy"] == pytest.approx(energy, rel=1e-9)
    run(world, 0.5)
    if kind == "revolute":
        assert spin(world) == pytest.approx(ROTATING.speed, rel=1e-3)
    else:
        run(world, 3.0)
        sag = 3 * MASS * G / (2 * SUSPENSION.stiffness)
        assert height(world) == pytest.approx(HEIGHT - sag, abs=0.02 * sag)


# --- machines of blocks --------------------------------------------------------------------

ROOT, BEAM, ROTOR, BALLAST, BRACE = (0, -1, -1), 15, 22, 35, 7


def arms(count: int) -> Machine:
    """Arms of two beams and three ballasts on rotating blocks in one line, joined by braces."""
    rows: list[Row] = [ROOT]

    def add(kind: int, parent: int, facing: str) -> int:
        rows.append((kind, parent, face_towards(machine(*rows), parent, facing)))
        return len(rows) - 1

    carriers, tips = [0], []
    if count == 2:
        at = add(BEAM, add(BEAM, 0, "z-"), "z-")
        for facing in ("x+",) * 5 + ("z+",) * 2:
            at = add(BEAM, at, facing)
        carriers.append(at)
    for carrier in carriers:
        hub = add(BEAM, add(ROTOR, carrier, "x+"), "x+")
        middle = add(BEAM, hub, "y+")
        tip = add(BEAM, middle, "y+")
        for facing in ("y+", "z+", "z-"):
            add(BALLAST, tip, facing)
        tips.append((middle, tip))
    if count == 2:
        for one, other in zip(*tips, strict=True):
            ends = (one, face_towards(machine(*rows), one, "x+"))
            rows.append((BRACE, *ends, other, face_towards(machine(*rows), other, "x-")))
    return machine(*rows)


def test_two_braced_arms_swing_like_one(calm: Engine) -> None:
    speeds = []
    for count in (1, 2):
        rig = Rig(calm, arms(count))
        rig.world.switch("motors", 1.0)
        rig.run(0.15)
        speeds.append(rig.spin(1 if count == 1 else 10, X))
    assert speeds[0] > 5.0
    assert speeds[1] == pytest.approx(speeds[0], rel=0.03)
