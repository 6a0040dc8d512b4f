"""What blocks are to the touch: pads, wheels and wood, the boulder, ballast and braces."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, EngineSpec, World
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import FACINGS, RATE, Rig, run

ROOT = (0, -1, -1)
GRIP, ELASTIC, BALLAST, BOULDER = 49, 87, 35, 36
GRAVITY = 32.81


def start(engine: Engine, tree: Machine, scene: Scene | None = None) -> World:
    geometry = place(tree)
    assert not geometry.overlaps
    return engine.build(assemble(tree, geometry, constants()), scene or Scene(), RATE)


@pytest.mark.parametrize(("foot", "friction"), [(15, 0.8), (GRIP, sqrt(2.0 * 0.8)), (ELASTIC, 0.8)])
def test_feet_slide_when_the_wind_beats_their_friction(
    engine: Engine, foot: int, friction: float
) -> None:
    """A cross on four feet: geometric mean of the partners' friction, times its weight."""
    arms = (ROOT, *((BALLAST, 0, face) for face in range(4)))
    down = [
        next(f.face_id for f in b.faces if f.facing == "y-")
        for b in place(machine(*arms, *((15, i, 0) for i in range(1, 5)))).blocks[5:]
    ]
    tree = machine(
        *arms, *((15, i, 0) for i in range(1, 5)), *((foot, 5 + i, f) for i, f in enumerate(down))
    )
    assembly = assemble(tree, place(tree), constants())
    mass = sum(part.mass for part in assembly.parts)
    area = sum(part.extents[1] * part.extents[2] for part in assembly.parts)
    limit = sqrt(friction * mass * GRAVITY / (0.6 * area))
    moved = []
    for share in (0.93, 1.07):
        world = start(engine, tree, Scene(wind=(limit * share, 0.0, 0.0)))
        world.switch("wind", 0.0)  # elastic feet bob at first
        run(world, 1.0)
        world.switch("wind", 1.0)
        run(world, 1.5)
        moved.append(world.centre(0)[0])
    assert moved[0] < 0.05
    assert moved[1] > 0.3


@pytest.mark.parametrize(
    ("pad", "bounce"), [(ELASTIC, 0.9), (GRIP, sqrt(0.18 * 0.9)), (15, sqrt(0.18 * 0.9))]
)
def test_a_lively_ball_bounces_as_the_pad_lets_it(
    engine: Engine, engine_spec: EngineSpec, pad: int, bounce: float
) -> None:
    """Rebound speed over fall: the geometric mean of the partners' restitution.

    On MuJoCo a rebound lasts several steps: gravity takes some of it, and it depends on when in a
    step the ball hits.
    """
    tree = machine(ROOT, *((BALLAST, 0, face) for face in range(4)), (pad, 0, 4))
    top = place(tree).box_max[1] - place(tree).box_min[1]
    ball = SceneObject(
        "ball", "sphere", (0.6,) * 3, (0.0, top + 2.3, 0.0), mass=0.1, restitution=0.9
    )
    world = start(engine, tree, Scene((ball,)))
    fall = rise = 0.0
    for _ in range(round(0.8 * RATE)):
        world.step()
        speed = float(world.state().object_velocity[0][1])
        fall, rise = min(fall, speed), max(rise, speed)
    tolerance = 0.05 if engine_spec.name == "pybullet" else 0.2
    assert rise / -fall == pytest.approx(bounce, rel=tolerance)


@pytest.mark.parametrize("restitution", [0.18, 0.6])
def test_the_ground_is_as_lively_as_the_constants_say(
    restitution: float, make_engine: MakeEngine
) -> None:
    physics = constants().changed({"restitution": restitution})
    engine = make_engine(physics)
    ball = SceneObject("ball", "sphere", (0.6,) * 3, (5.0, 2.3, 0.0), mass=0.1)
    tree = machine(ROOT)
    world = engine.build(assemble(tree, place(tree), physics), Scene((ball,)), RATE)
    speeds = []
    for _ in range(round(0.6 * RATE)):
        world.step()
        speeds.append(float(world.state().object_velocity[0][1]))
    assert max(speeds) / -min(speeds) == pytest.approx(restitution, abs=0.08)


def test_a_boulder_is_loose_and_rolls_as_its_friction_says(engine: Engine) -> None:
    """Blown along and then left alone, it rolls; v = omega r."""
    world = start(engine, machine(ROOT, (BOULDER, 0, 0)), Scene(wind=(0.0, 0.0, 6.0)))
    run(world, 2.0)
    state = world.state()
    radius = 0.95 - constants()["shrink"]
    speed = float(state.velocity[1][2])
    assert speed > 1.0
    assert np.linalg.norm(state.angular_velocity[1]) * radius == pytest.approx(speed, rel=0.02)


@pytest.mark.parametrize("kind", [1, 15, 30, BALLAST, 41, 63, GRIP, ELASTIC, 27, 4])
@pytest.mark.parametrize("face", range(6), ids=FACINGS)
def test_rigid_blocks_stay_as_they_were_built(calm: Engine, kind: int, face: int) -> None:
    """Wind on every side: nothing moves against the root, and each weighs what the library says."""
    tree = machine(ROOT, (kind, 0, face))
    rig = Rig(calm, tree, wind=(12.0, 9.0, -15.0))
    rig.run(0.5)
    assert rig.moved(1) == pytest.approx([0, 0, 0], abs=2e-3)
    assert rig.angle(1, (0.0, 0.0, 1.0)) == pytest.approx(0.0, abs=1e-6)
    assert rig.assembly.parts[1].mass == library()[kind].mass


def test_a_brace_makes_a_hinge_stiff(calm: Engine) -> None:
    """The same hinged log with and without a brace to the post, in the same wind."""
    base = (ROOT, (63, 0, 4), (5, 0, 3), (63, 2, 0))
    free = Rig(calm, machine(*base), wind=(0.0, -12.0, 0.0))
    free.run(1.0)
    assert abs(free.angle(3, (0.0, 0.0, 1.0))) > 1.0
    braced = Rig(calm, machine(*base, (7, 1, 6, 3, 8)), wind=(0.0, -12.0, 0.0))
    braced.run(1.0)
    assert braced.angle(3, (0.0, 0.0, 1.0)) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("higher", np.arange(0.0, 0.2, 0.01))
def test_a_touch_is_seen_however_short(engine: Engine, higher: float) -> None:
    """At 25 m/s a ball may be above the ground before a step and on its way up after it."""
    ball = SceneObject("ball", "sphere", (1.0, 1.0, 1.0), (20.0, 10.0 + higher, 0.0), mass=1.0)
    world = start(engine, machine(ROOT), Scene((ball,)))
    while world.state().object_velocity[0, 1] <= 0.0:
        world.step()
    assert world.touching("ball") == {"ground"}


def test_objects_that_never_move_are_not_tested_against_each_other(engine: Engine) -> None:
    """Rough ground is hundreds of them, side by side."""
    size = (1.0, 1.0, 1.0)
    stones = (
        SceneObject("a", "box", size, (5.0, 0.2, 0.0)),
        SceneObject("b", "box", size, (5.5, 0.2, 0.0)),
    )
    ball = SceneObject("ball", "sphere", size, (5.0, 1.1, 0.0), mass=1.0)
    world = start(engine, machine(ROOT), Scene((*stones, ball)))
    run(world, 0.25)
    assert "a" not in world.touching("b")
    assert "a" in world.touching("ball")
