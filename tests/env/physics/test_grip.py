"""Grabbers hold what they touch and let go; decouplers part; containers keep their boulder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.model import Assembly
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Schedule
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.machines import CAR, machine
from tests.env.physics.rig import FACINGS, RATE, run

ROOT = (0, -1, -1)
FOOT = (ROOT, (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3))
GRABBER, BOULDER = 27, 36


def start(engine: Engine, tree: Machine, scene: Scene | None = None) -> tuple[World, Assembly]:
    geometry = place(tree)
    assert not geometry.overlaps
    assembly = assemble(tree, geometry, constants())
    world = engine.build(assembly, scene or Scene(), RATE)
    return world, assembly


def crane(facing: str) -> tuple[Machine, int, int]:
    """A grabber that faces there with a boulder on its front, and their ids."""
    rows = [*FOOT, (63, 0, 4), (63, 5, 0), (15, 6, 0)]
    if facing == "y-":
        rows.append((63, 7, 1))
    tree = machine(*rows)
    arm = len(rows) - 1
    faces = place(tree).blocks[arm].faces
    face = [f.face_id for f in faces if f.facing == facing][-1]
    return machine(*rows, (GRABBER, arm, face), (BOULDER, arm + 1, 0)), arm + 1, arm + 2


@pytest.mark.parametrize("facing", FACINGS)
def test_a_grabber_holds_ten_times_its_weight_and_lets_go(engine: Engine, facing: str) -> None:
    tree, grabber, boulder = crane(facing)
    assert library()[BOULDER].mass == 10 * library()[GRABBER].mass
    assert place(tree).blocks[grabber].facing == facing
    world, _ = start(engine, tree)
    before = np.subtract(world.centre(boulder), world.centre(grabber))
    run(world, 3.0)
    now = np.subtract(world.centre(boulder), world.centre(grabber))
    assert now == pytest.approx(before, abs=0.02)
    high = world.centre(boulder)[1]
    assert high > 4.0
    world.switch("grabbers", 0)
    run(world, 0.4)
    if facing == "y+":
        assert world.centre(boulder)[1] == pytest.approx(high, abs=0.05)
    else:
        fallen = high - world.centre(boulder)[1]
        assert fallen == pytest.approx(0.5 * 32.81 * 0.4**2, rel=0.05)


def test_what_a_grabber_holds_loads_its_connection(engine: Engine) -> None:
    tree, grabber, _ = crane("x+")
    world, assembly = start(engine, tree)
    run(world, 2.0)
    joint = next(i for i, joint in enumerate(assembly.joints) if joint.block == grabber)
    load = world.reactions[joint]
    assert np.linalg.norm(load[:3]) == pytest.approx(5.5 * 32.81, rel=0.01)
    moment = 32.81 * (0.5 * 0.5 + 5.0 * 1.95)
    assert np.linalg.norm(load[3:]) == pytest.approx(moment, rel=0.01)


@pytest.mark.parametrize(("share", "holds"), [(0.5, False), (2.0, True)])
def test_a_grabber_holds_no_more_than_its_force(engine: Engine, share: float, holds: bool) -> None:
    """What hangs from it weighs twice or half as much."""
    tree, _, boulder = crane("y-")
    assembly = assemble(tree, place(tree), constants())
    weight = library()[BOULDER].mass * constants()["gravity"]
    grips = tuple(replace(grip, force=share * weight) for grip in assembly.devices.grippers)
    assembly = replace(assembly, devices=replace(assembly.devices, grippers=grips))
    world = engine.build(assembly, Scene(), RATE)
    high = world.centre(boulder)[1]
    run(world, 1.0)
    assert (high - world.centre(boulder)[1] < 0.05) == holds


def test_a_grip_outlives_a_split(engine: Engine) -> None:
    tree, grabber, boulder = crane("z+")
    world, assembly = start(engine, tree)
    run(world, 1.0)
    before = np.subtract(world.centre(boulder), world.centre(grabber))
    world.split([i for i, joint in enumerate(assembly.joints) if joint.block == 1])
    run(world, 0.5)
    now = np.subtract(world.centre(boulder), world.centre(grabber))
    assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(before), abs=0.01)
    assert world.centre(boulder)[1] > 4.0


CARGO = SceneObject("cargo", "sphere", (2.0, 2.0, 2.0), (0.0, 1.0, 12.0), mass=2.0, friction=0.1)


def test_a_grabber_takes_an_object_along_and_leaves_it(engine: Engine) -> None:
    """A car drives into a ball, backs off with it, lets go and drives on without."""
    rows = [(s.type, s.parent, s.face_id) for s in CAR]
    world, _ = start(engine, machine(*rows, (GRABBER, 1, 0)), Scene((CARGO,)))
    run(world, 0.3)
    assert world.touching(7) == frozenset()
    world.switch("motors", 1)
    run(world, 2.5)
    apart = world.state().object_position[0] - world.state().position[0]
    world.switch("motors", -1)
    run(world, 1.5)
    assert world.state().velocity[0][2] < -2.0
    now = world.state().object_position[0] - world.state().position[0]
    assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(apart), abs=0.05)
    world.switch("grabbers", 0)
    run(world, 1.5)
    now = world.state().object_position[0] - world.state().position[0]
    assert np.linalg.norm(now) > np.linalg.norm(apart) + 1.0
    world.switch("motors", 1)
    world.switch("grabbers", 1)
    run(world, 4.0)
    again = world.state().object_position[0] - world.state().position[0]
    assert np.linalg.norm(again) == pytest.approx(np.linalg.norm(apart), abs=0.2)


def test_a_grabber_does_not_catch_what_breaks_off_it(engine: Engine) -> None:
    rows = (*FOOT, (63, 0, 4), (63, 5, 0), (GRABBER, 6, 9), (15, 7, 0))
    world, assembly = start(engine, machine(*rows))
    run(world, 0.3)
    high = world.centre(8)[1]
    world.split([i for i, joint in enumerate(assembly.joints) if joint.block == 8])
    run(world, 0.4)
    assert high - world.centre(8)[1] == pytest.approx(0.5 * 32.81 * 0.4**2, rel=0.05)


def test_a_grabber_does_not_hold_the_ground(engine: Engine) -> None:
    world, _ = start(engine, machine(*FOOT, (GRABBER, 0, 5)), Scene(wind=(0.0, 0.0, 30.0)))
    run(world, 1.0)
    assert world.touching(5) <= {"ground"}
    assert world.centre(0)[2] > 1.0


def test_a_grabber_grips_with_its_front_only(engine: Engine) -> None:
    """A boulder that lies on the grabber's side is not held."""
    tree = machine(*FOOT, (63, 0, 4), (GRABBER, 5, 9))
    x, y, z = np.add(place(tree).blocks[6].center, (0.0, 2.6, 0.0))
    ball = SceneObject("ball", "sphere", (1.0, 1.0, 1.0), (x, y, z), mass=1.0)
    world, _ = start(engine, tree, Scene((ball,), wind=(6.0, 0.0, 0.0)))
    run(world, 2.0)
    assert world.centre("ball")[1] < 1.0


@dataclass(frozen=True)
class Anything(Movement):
    """Movement with every block of the library."""

    @property
    def brief(self) -> Brief:
        return replace(super().brief, blocks=tuple(library()))


@pytest.mark.parametrize("facing", FACINGS)
def test_a_decoupler_lets_go_at_its_time(facing: str) -> None:
    """A log on a decoupler at the top of a post falls off when the schedule says so, once."""
    rows = [*FOOT, (63, 0, 4), (15, 5, 0)]
    if facing == "y-":
        rows.append((63, 6, 1))
    face = [f.face_id for f in place(machine(*rows)).blocks[-1].faces if f.facing == facing][-1]
    tree = machine(*rows, (4, len(rows) - 1, face), (15, len(rows), 0))
    decoupler = len(rows)
    assert place(tree).blocks[decoupler].facing == facing
    task = get_task("movement", {"window": 2})
    twice = ((1.0, "decouplers", 1.0), (1.5, "decouplers", 1.0))
    task = Anything(**{**vars(task), "schedule": Schedule(more=twice)})
    rollout = simulate(tree, task)
    assert rollout.problems == ()
    assert rollout.trace is not None
    assert rollout.broken == ()
    told = [(e.time, e.kind, e.blocks, e.text) for e in rollout.events if e.kind == "released"]
    text = f"block {decoupler} let go of block {decoupler - 1}"
    assert told == [(1.0, "released", (decoupler,), text)]
    alive = rollout.trace.alive[:, decoupler]
    assert alive.tolist() == [time < 1.001 for time in rollout.trace.times]
    high = rollout.trace.even.centre[:, decoupler, 1]
    assert high[:6] == pytest.approx(high[0], abs=0.01)
    if facing != "y+":
        assert high[7] < high[0] - 1.0


def test_a_boulder_stays_in_a_container_through_a_gentle_drive(engine: Engine) -> None:
    """A car speeds up to 9 m/s with a boulder in an open container on top."""
    rows = [(s.type, s.parent, s.face_id) for s in CAR]
    world, _ = start(engine, machine(*rows, (15, 0, 4), (30, 7, 0), (BOULDER, 8, 0)))
    run(world, 0.5)
    before = np.subtract(world.centre(9), world.centre(8))
    world.switch("motors", 1)
    fastest = 0.0
    for _ in range(4):
        run(world, 1.0)
        inside = np.subtract(world.centre(9), world.centre(8))
        assert np.abs(inside - before).max() < 0.6
        assert world.touching(9) == {8}
        fastest = max(fastest, float(world.state().velocity[0][2]))
    assert fastest > 5.0


@pytest.mark.parametrize("facing", FACINGS)
def test_a_container_keeps_its_boulder_unless_it_faces_down(engine: Engine, facing: str) -> None:
    rows = [*FOOT, (63, 0, 4), (63, 5, 0), (15, 6, 0)]
    if facing == "y-":
        rows += [(63, 7, 1)]
    face = [f.face_id for f in place(machine(*rows)).blocks[-1].faces if f.facing == facing][-1]
    tree = machine(*rows, (30, len(rows) - 1, face), (BOULDER, len(rows), 0))
    world, _ = start(engine, tree)
    high = world.centre(len(rows) + 1)[1]
    run(world, 2.0)
    fallen = high - world.centre(len(rows) + 1)[1]
    assert (fallen > 3.0) == (facing == "y-")
    assert fallen < 0.5 or facing == "y-"  # sideways it rolls from the middle onto a wall
