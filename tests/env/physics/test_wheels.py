"""Wheels of every kind: which way they drive, how they roll and swivel."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.rotations import rotate
from agentflow.env.scene import Scene
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine
from tests.env.machines import Row, machine
from tests.env.physics.rig import FACINGS, RATE, Rig, run

ROOT = (0, -1, -1)
AXLES = {
    "x": (ROOT, (1, 0, 0), (1, 0, 1)),
    "z": (ROOT, (1, 0, 2), (1, 0, 3)),
}
"""Frames along z for axles along x, and the reverse."""


def firsts(quick: list[Any], others: list[Any]) -> list[Any]:
    """Parameters of which the fast part has the first ones: one along each axis."""
    return quick + [pytest.param(other, marks=pytest.mark.slow) for other in others]


def car(facing: str, wheel: int, other: int) -> Machine:
    """Two wheels that face there at the far ends of the frame, two other ones opposite."""
    frame = AXLES[facing[0]]
    rows: list[Row] = list(frame)
    for beam in (1, 2):
        for face in place(machine(*frame)).blocks[beam].faces:
            outermost = abs(face.position[2 if facing[0] == "x" else 0]) == 2.0
            if outermost and face.facing[0] == facing[0]:
                rows.append((wheel if face.facing == facing else other, beam, face.face_id))
    return machine(*rows)


def start(engine: Engine, tree: Machine, wind: Vec3 = (0.0, 0.0, 0.0)) -> World:
    geometry = place(tree)
    assert not geometry.overlaps
    return engine.build(assemble(tree, geometry, constants()), Scene(wind=wind), RATE)


@pytest.mark.parametrize(("wheel", "other"), [(2, 40), (46, 60)], ids=["small", "large"])
@pytest.mark.parametrize(
    ("facing", "way"),
    [("x+", (0, 0, 1)), ("x-", (0, 0, 1)), ("z+", (-1, 0, 0)), ("z-", (1, 0, 0))],
)
def test_driven_wheels_drive_the_way_their_facing_says(
    engine: Engine, facing: str, way: Vec3, wheel: int, other: int
) -> None:
    tree = car(facing, wheel, other)
    assert [b.facing for b in place(tree).blocks if b.type == wheel] == [facing] * 2
    world = start(engine, tree)
    run(world, 0.3)
    world.switch("motors", 1)
    before = np.array(world.centre(0))
    run(world, 1.0)
    moved = np.array(world.centre(0)) - before
    assert moved @ way > 1.5
    assert abs(np.cross(moved, way)[1]) < 0.3 * (moved @ way)


@pytest.mark.parametrize("wheel", [2, 46], ids=["small", "large"])
@pytest.mark.parametrize("face", range(6), ids=FACINGS)
def test_wheels_turn_about_their_front_at_their_speed(calm: Engine, wheel: int, face: int) -> None:
    rig = Rig(calm, machine(ROOT, (wheel, 0, face)))
    rig.world.switch("motors", 1)
    rig.run(1.0)
    front, speed = rig.blocks[1].front, constants().of("motor_speed", wheel)
    assert rig.spin(1, front) == pytest.approx(
        -speed if rig.blocks[1].facing == "x-" else speed, rel=1e-3
    )
    rig.angle(1, front)


@pytest.mark.parametrize("wheel", [2, 46], ids=["small", "large"])
def test_wheels_that_face_up_or_down_do_not_drive(engine: Engine, wheel: int) -> None:
    for face in (4, 5):
        world = start(engine, machine(ROOT, (35, 0, 0), (35, 0, 1), (wheel, 0, face)))
        run(world, 0.3)
        world.switch("motors", 1)
        before = np.array(world.centre(0))
        run(world, 1.0)
        assert np.abs(world.centre(0) - before).max() < 0.2


@pytest.mark.parametrize("wheel", [40, 60], ids=["small", "large"])
@pytest.mark.parametrize(("facing", "way"), [("x+", 2), ("z+", 0)])
def test_free_wheels_roll_without_slipping(
    engine: Engine, facing: str, way: int, wheel: int
) -> None:
    tree = car(facing, wheel, wheel)
    wind = (0.0, 0.0, 5.0) if way == 2 else (5.0, 0.0, 0.0)
    world = start(engine, tree, wind)
    run(world, 3.0)
    state, size = world.state(), library()[wheel].size
    assert size is not None
    radius = size[0] / 2 - constants()["shrink"]
    speed = state.velocity[0][way]
    assert speed > 1.0
    for block in range(3, 7):
        assert np.linalg.norm(state.angular_velocity[block]) * radius == pytest.approx(
            speed, rel=0.01
        )


@pytest.mark.parametrize("kind", [40, 60, 38, 51], ids=["small", "large", "cog", "large cog"])
@pytest.mark.parametrize("face", firsts([0, 3, 4], [1, 2, 5]), ids=lambda face: FACINGS[face])
def test_free_wheels_turn_about_their_front(calm: Engine, kind: int, face: int) -> None:
    """On a motor that turns about the same axis they are left behind: only their dry friction takes
    them along."""
    rig = Rig(calm, machine(ROOT, (22, 0, face), (kind, 1, 0)))
    front, seconds = rig.blocks[2].front, 0.1
    rig.world.switch("motors", 1)
    rig.run(0.05)
    before = rig.spin(2, front)
    rig.run(seconds)
    moment = np.abs(front) @ rig.assembly.parts[2].inertia
    gained = constants().of("joint_friction", kind) / moment * seconds
    assert rig.spin(2, front) - before == pytest.approx(gained, rel=0.01)
    assert rig.spin(1, front) == pytest.approx(constants().of("motor_speed", 22), rel=1e-3)
    assert rig.angle(2, front) < 0.5 * rig.angle(1, front)


def test_free_wheels_stand_still_on_flat_ground(engine: Engine) -> None:
    world = start(engine, car("x+", 40, 40))
    run(world, 0.5)
    assert max(world.speeds()) < 0.01


@pytest.mark.parametrize("kind", [50, 86], ids=["small wheel", "roller wheel"])
@pytest.mark.parametrize("way", firsts([(1, 0, 0), (0, 0, -1)], [(-1, 0, 0), (0, 0, 1)]))
def test_casters_swivel_behind_where_they_go_and_roll(engine: Engine, kind: int, way: Vec3) -> None:
    """Four casters under a cross, which the wind pushes: each fork's Up points there.

    The wind blows a little askew: forks that point exactly the other way at first may stay so.
    """
    arms = ((15, 0, 0), (15, 0, 1), (15, 0, 2), (15, 0, 3))
    cross = machine(ROOT, *arms, *((15, i, 0) for i in range(1, 5)))
    down = [
        next(f.face_id for f in block.faces if f.facing == "y-")
        for block in place(cross).blocks[5:]
    ]
    rows = [(s.type, s.parent, s.face_id) for s in cross]
    tree = machine(*rows, *((kind, 5 + i, face) for i, face in enumerate(down)))
    assert {b.facing for b in place(tree).blocks[9:]} == {"y-"}
    world = start(engine, tree, tuple(9.0 * x + 0.5 for x in way))  # type: ignore[arg-type]
    run(world, 3.0)
    state = world.state()
    going = state.velocity[0] / np.linalg.norm(state.velocity[0])
    assert going @ way > 0.97
    assert np.linalg.norm(state.velocity[0]) > 7.0
    ups = [rotate(state.rotation[block], (0.0, 1.0, 0.0)) for block in range(9, 13)]
    assert sorted(up @ going for up in ups)[1] > 0.95  # the fourth may hang in the air


@pytest.mark.parametrize("kind", [50, 86], ids=["small wheel", "roller wheel"])
@pytest.mark.parametrize("face", firsts([0, 3, 4], [1, 2, 5]), ids=lambda face: FACINGS[face])
def test_casters_swivel_about_their_front(calm: Engine, kind: int, face: int) -> None:
    """The wheel hangs off the swivel, so the wind turns it: the fork's Up to windward."""
    tree = machine(ROOT, (kind, 0, face))
    right = np.array(Rig(calm, tree).blocks[1].right)
    rig = Rig(calm, tree, wind=12.0 * right)
    rig.run(2.0)
    block = rig.blocks[1]
    rig.angle(1, block.front)
    assert rig.turned(1, block.up) @ right < -0.95
