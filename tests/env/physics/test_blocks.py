"""How blocks move, what joints bear, what a split keeps."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly, Part, Shape
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import IDENTITY
from agentflow.machine.tree import Machine
from tests.env.machines import BALLASTED, CAR, CRADLE, machine
from tests.env.physics.rig import run

GRAVITY = 32.81


def start(engine: Engine, tree: Machine, scene: Scene | None = None) -> tuple[World, Assembly]:
    assembly = assemble(tree, place(tree), constants())
    world = engine.build(assembly, scene or Scene(), 120.0)
    return world, assembly


def test_a_machine_starts_on_the_ground_over_the_middle(engine: Engine) -> None:
    world, _ = start(engine, CAR)
    state = world.state()
    assert state.position[0].tolist() == pytest.approx([0.0, 1.0, 0.0])
    assert state.centre[3].tolist() == pytest.approx([-0.75, 1.0, 1.0])
    assert state.rotation[3].tolist() == pytest.approx([0.0, -(0.5**0.5), 0.0, 0.5**0.5])
    assert world.centre(3) == pytest.approx((-0.75, 1.0, 1.0))
    assert world.rotation(3) == pytest.approx(state.rotation[3].tolist())
    assert world.origin(3) == pytest.approx(state.position[3].tolist())


@pytest.mark.parametrize(("face", "sign"), [(2, -1), (3, 1)])
def test_a_rotating_block_turns_clockwise_seen_from_its_front(
    engine: Engine, face: int, sign: int
) -> None:
    """Facing x- it sends the top of an upright arm to z-, facing x+ to z+."""
    base = ((0, -1, -1), (35, 0, 0), (35, 0, 1), (35, 0, 3 if face == 2 else 2))
    tree = machine(*base, (22, 0, face), (63, 4, 3))
    arm = place(tree).blocks[5]
    assert arm.facing == "y+"
    world, _ = start(engine, tree)
    run(world, 0.3)
    before = world.centre(5)
    world.switch("motors", True)
    run(world, 0.1)
    assert sign * (world.centre(5)[2] - before[2]) > 0.3


@pytest.mark.parametrize("kind", list(library()))
def test_every_block_of_the_library_moves_without_fault(engine: Engine, kind: int) -> None:
    root: tuple[int, ...] = (0, -1, -1)
    block = library()[kind]
    if kind == 0:
        tree = machine(root)
    elif block.linear:
        tree = machine(root, (63, 0, 0), (kind, 0, 4, 1, 8))
    else:
        tree = machine(root, *((kind, 0, face) for face in (0, 1, 2, 3, 4)))
        if place(tree).overlaps:
            tree = machine(root, (kind, 0, 0), (63, 0, 1))
    world, _ = start(engine, tree)
    run(world, 0.5)
    for entry in ("motors", "springs", "steering_hinges"):
        world.switch(entry, True)
    run(world, 0.5)
    assert max(world.speeds()) < 60.0
    assert np.isfinite(world.state().position).all()


def test_a_cantilever_bears_what_statics_says(engine: Engine) -> None:
    """Two logs to the right at the top of a post, balanced by ballast at the left."""
    tree = machine(
        (0, -1, -1),
        (35, 0, 2),
        (35, 0, 3),
        (35, 0, 0),
        (35, 0, 1),
        (1, 0, 4),
        (63, 5, 4),
        (63, 6, 0),
        (35, 5, 2),
    )
    world, assembly = start(engine, tree)
    run(world, 1.5)
    force = {joint.block: world.reactions[i] for i, joint in enumerate(assembly.joints)}
    assert np.linalg.norm(force[6][:3]) == pytest.approx(2 * GRAVITY, rel=0.01)
    assert np.linalg.norm(force[6][3:]) == pytest.approx(2 * GRAVITY * 3.0, rel=0.01)
    assert np.linalg.norm(force[7][3:]) == pytest.approx(GRAVITY * 1.5, rel=0.01)
    post = 2 * GRAVITY * 3.5 - 3 * GRAVITY * 1.0
    assert np.linalg.norm(force[5][3:]) == pytest.approx(post, rel=0.01)
    assert np.linalg.norm(force[5][:3]) == pytest.approx(5.5 * GRAVITY, rel=0.01)


def test_a_boulder_stays_in_a_container(engine: Engine) -> None:
    world, _ = start(engine, CRADLE)
    before = world.centre(6)
    run(world, 3.0)
    assert world.centre(6) == pytest.approx(before, abs=0.06)
    assert world.touching(6) == {5}
    assert 6 in world.touching(5)
    assert "ground" in world.touching(1)
    assert max(world.speeds()) < 0.05


def test_drag_slows_as_the_law_says(engine: Engine) -> None:
    """A part in free fall, every step: v' = -g - 0.2 v."""
    high = (0.0, 80.0, 0.0)
    part = Part(0, high, 0.25, (0.04, 0.04, 0.04), (Shape("box", (1, 1, 1)),), linear_drag=0.2)
    lone = Assembly((part,), (), ((0,),), (high,), (high,), (IDENTITY,))
    world = engine.build(lone, Scene(), 120.0)
    speed = 0.0
    for _ in range(120):
        world.step()
        speed -= (GRAVITY + 0.2 * speed) / 120
    assert world.state().velocity[0].tolist() == pytest.approx([0.0, speed, 0.0], rel=1e-9)


def test_wind_pushes_with_area_and_square_of_speed(engine: Engine) -> None:
    ball = SceneObject("ball", "sphere", (2, 2, 2), (20.0, 50.0, 0.0), mass=4.0)
    world, _ = start(engine, machine((0, -1, -1)), Scene((ball,), wind=(0.0, 0.0, -6.0)))
    world.step()
    push = 0.6 * 4.0 * 36.0 / 4.0
    assert world.state().object_velocity[0].tolist() == pytest.approx(
        [0.0, -GRAVITY / 120, -push / 120]
    )


def test_a_suspension_gives_way_by_load_over_stiffness(engine: Engine) -> None:
    world, _ = start(engine, machine((0, -1, -1), (35, 0, 2), (35, 0, 3), (16, 0, 4), (35, 3, 0)))
    high = world.centre(4)[1] - world.centre(0)[1]
    run(world, 3.0)
    sunk = high - (world.centre(4)[1] - world.centre(0)[1])
    assert sunk == pytest.approx(3.5 * GRAVITY / constants()["suspension_stiffness"], rel=0.01)


@pytest.mark.parametrize(("kind", "face"), [(50, 7), (86, 8)])
def test_casters_roll_behind_driven_wheels(engine: Engine, kind: int, face: int) -> None:
    car = ((0, -1, -1), (1, 0, 0), (1, 0, 1), (2, 1, 2), (2, 1, 4))
    gained = []
    for tree in (machine(*car), machine(*car, (kind, 2, face))):
        world, _ = start(engine, tree)
        run(world, 0.5)
        before = world.centre(0)[2]
        world.switch("motors", True)
        run(world, 2.0)
        gained.append(world.centre(0)[2] - before)
    assert gained[1] > 1.04 * gained[0] > 5.0
    assert gained[1] > 15.5


@pytest.mark.parametrize("face", [1, 2, 3, 4])
def test_a_hinge_swings_down_until_its_log_meets_the_post(engine: Engine, face: int) -> None:
    base = ((0, -1, -1), (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3), (63, 0, 4), (15, 5, 0))
    tree = machine(*base, (5, 6, face), (1, 7, 0))
    world, assembly = start(engine, tree)
    pivot = next(joint.pivot for joint in assembly.joints if joint.block == 7)
    run(world, 2.0)
    tip = world.centre(8)
    assert tip[1] < pivot[1] - 1.4


def test_a_spring_pulls_its_ends_together(engine: Engine) -> None:
    base = ((0, -1, -1), (35, 0, 1), (35, 0, 2), (35, 0, 3), (63, 0, 4), (63, 4, 0))
    tree = machine(*base, (5, 4, 9), (63, 6, 0), (9, 5, 9, 7, 9))
    world, _ = start(engine, tree)
    run(world, 0.5)
    before = world.state().length[0]
    world.switch("springs", True)
    run(world, 0.25)
    assert world.state().length[0] < before - 0.3


def test_a_split_keeps_every_place_and_the_momentum(engine: Engine) -> None:
    world, _ = start(engine, BALLASTED)
    run(world, 0.3)
    world.switch("motors", True)
    run(world, 0.3)
    for joints in ([7], [0, 5], [10]):
        before, state = world.momentum(), world.state()
        world.split(joints)
        after, same = world.momentum(), world.state()
        for name, value in before.items():
            assert np.abs(after[name] - value).max() <= 1e-10 * np.abs(value).max()
        for name in ("position", "rotation", "velocity", "angular_velocity"):
            assert getattr(same, name) == pytest.approx(getattr(state, name), abs=1e-9)
        run(world, 0.05)


def test_a_brace_takes_over_when_the_tree_breaks(engine: Engine) -> None:
    base = ((0, -1, -1), (35, 0, 2), (35, 0, 0), (35, 0, 1), (1, 0, 4))
    world, assembly = start(engine, machine(*base, (15, 4, 4), (7, 4, 0, 5, 3)))
    broken = [i for i, joint in enumerate(assembly.joints) if joint.block == 5]
    high = world.centre(5)[1]
    world.split(broken)
    run(world, 0.5)
    assert world.centre(5)[1] == pytest.approx(high, abs=0.05)
    world.split([i for i, joint in enumerate(assembly.joints) if joint.partner == 5])
    run(world, 0.5)
    assert world.centre(5)[1] < high - 1.0


def test_a_brace_across_a_hinge_locks_it() -> None:
    tree = machine((0, -1, -1), (5, 0, 0), (63, 1, 0), (7, 0, 4, 2, 9))
    assembly = assemble(tree, place(tree), constants())
    assert [assembly.joints[i].block for i in Loads(assembly.joints, 0.02, 1 / 120).locked] == [1]


def test_centres_are_those_of_the_state(engine: Engine) -> None:
    tree = machine((0, -1, -1), (2, 0, 2), (2, 0, 3), (63, 0, 4), (9, 3, 0, 1, 0), (7, 3, 2, 0, 0))
    world, _ = start(engine, tree)
    world.switch("motors", 1.0)
    run(world, 0.5)
    assert (world.centres() == world.state().centre).all()
    assert world.centres()[:4] == pytest.approx(np.array([world.centre(i) for i in range(4)]))
