"""Objects whose centre of mass lies beside their centre: where they are, and how they fall."""

from __future__ import annotations

from math import sqrt

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Quat, Vec3, rotate_vector
from tests.env.conftest import MakeEngine
from tests.env.machines import machine
from tests.env.physics.rig import RATE, weightless

ALONE = machine((0, -1, -1))
TURNED: Quat = (0.0, sqrt(0.5), 0.0, sqrt(0.5))
"""Its x+ side towards z-."""


def box(position: Vec3, rotation: Quat = (0.0, 0.0, 0.0, 1.0), heavy: float = 0.4) -> SceneObject:
    return SceneObject("box", "box", (2, 1, 2), position, rotation, mass=10, balance=(heavy, 0, 0))


def run(item: SceneObject, seconds: float, engine: Engine, wind: Vec3 = (0, 0, 0)) -> World:
    assembly = assemble(ALONE, place(ALONE), constants())
    world = engine.build(assembly, Scene((item, *LEDGE), wind), RATE)
    for _ in range(round(seconds * RATE)):
        world.step()
    return world


def side(world: World, local: Vec3) -> Vec3:
    """Where a direction of the box points."""
    return rotate_vector(world.rotation("box"), local)


LEDGE = (SceneObject("ledge", "box", (4, 4, 4), (10.0, 2.0, 0.0)),)
"""Its near edge at x = 8, its top 4 m high."""


@pytest.mark.parametrize(("shape", "height"), [("box", 1.0), ("cone", 2.0), ("sphere", 2.0)])
def test_its_place_is_told_by_its_centre(
    shape: str, height: float, make_engine: MakeEngine
) -> None:
    engine = make_engine()
    item = SceneObject(
        "box",
        shape,
        (2, height, 2),
        (5, 9, -7),
        TURNED,
        mass=10,
        balance=(0.4, 0, 0),  # type: ignore[arg-type]
    )
    world = run(item, 0.0, engine)
    assert world.centre("box") == pytest.approx((5, 9, -7))
    world = run(item, 0.1, engine)
    state = world.state()
    assert world.centre("box") == pytest.approx(state.object_position[0])
    assert world.centre("box")[::2] == pytest.approx((5, -7))
    assert world.rotation("box") == pytest.approx(TURNED)


@pytest.mark.parametrize(("heavy", "falls"), [(0.4, False), (-0.4, True), (0.0, False)])
def test_it_falls_off_an_edge_where_its_centre_of_mass_is_beyond_it(
    heavy: float, falls: bool, make_engine: MakeEngine
) -> None:
    """Its middle lies 0.2 m within the edge."""
    engine = make_engine()
    world = run(box((8.2, 4.5, 0.0), heavy=heavy), 1.5, engine)
    assert (world.centre("box")[1] < 3.0) is falls
    assert (side(world, (0.0, 1.0, 0.0))[1] < 0.9) is falls


def test_wind_turns_its_heavy_side_into_the_wind(make_engine: MakeEngine) -> None:
    engine = make_engine(weightless())
    world = run(box((-20.0, 50.0, 0.0)), 0.6, engine, wind=(0.0, 0.0, -5.0))
    assert side(world, (1.0, 0.0, 0.0))[2] > 0.1
    world = run(box((-20.0, 50.0, 0.0), heavy=0.0), 0.6, engine, wind=(0.0, 0.0, -5.0))
    assert side(world, (1.0, 0.0, 0.0))[2] == pytest.approx(0.0, abs=1e-9)


def test_while_it_spins_its_centre_moves_round_its_centre_of_mass(make_engine: MakeEngine) -> None:
    """In the wind as above: the velocity that is told is that of the centre."""
    engine = make_engine(weightless())
    world = run(box((-20.0, 50.0, 0.0)), 0.6, engine, wind=(0.0, 0.0, -5.0))
    before, told = world.centre("box"), world.state().object_velocity[0]
    world.step()
    moved = [(b - a) * RATE for a, b in zip(before, world.centre("box"), strict=True)]
    assert moved == pytest.approx(told, abs=0.1)
    assert abs(told[0]) > 0.05
