"""What prompts say in words about the physics, in every engine that is installed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, degrees, radians, sin

import numpy as np
import pytest

from agentflow.env.physics.engine import EngineSpec
from agentflow.env.physics.engines import installed_engines
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene, SceneObject, Start
from agentflow.machine import library, place
from agentflow.machine.brief import Limits
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.validity import size_problems
from agentflow.prompts.render import facts
from benchmarks.facts import HIGH, RATE, Stand, hold_ball, machine_of

Blocks = Sequence[tuple[int, ...]]
AXLE = [(22, 0, 3), (63, 1, 0), (63, 0, 5), (63, 3, 6), (63, 4, 0), (63, 5, 9)]
"""A log on a motor that faces x+, and a bent frame whose post 6 stands at the log's other end."""
WINDY = Scene(wind=(6.0, 0.0, 0.0), start=HIGH.start)


@pytest.fixture(params=installed_engines(), ids=lambda spec: spec.name)
def engine(request: pytest.FixtureRequest) -> EngineSpec:
    spec: EngineSpec = request.param
    return spec


def _geometry(blocks: Blocks) -> Geometry:
    return place(machine_of(blocks))


def _turned(before: Array, after: Array) -> float:
    """Degrees between two rotations."""
    return degrees(2.0 * np.arccos(min(1.0, abs(float(before @ after)))))


@pytest.mark.parametrize("motors", [1, 2, 3])
def test_speeds_of_coaxial_motors_on_each_other_add(engine: EngineSpec, motors: int) -> None:
    chain = [(22, parent, 0) for parent in range(motors)]
    stand = Stand(chain, engine=engine).run(0.3, motors=1)
    state = stand.world.state()
    assert abs(state.angular_velocity[motors]).max() == pytest.approx(8.0 * motors, rel=1e-3)


@pytest.mark.parametrize(("bearing", "speed"), [(19, 8.0), (13, 8.0), (22, 0.0), (5, 0.0)])
def test_an_axle_turns_unless_equal_motors_face_each_other(
    engine: EngineSpec, bearing: int, speed: float
) -> None:
    """A Steering Block is overcome by a Rotating Block; a hinge turns about another axis."""
    blocks = [*AXLE, (bearing, 6, 3)]
    (joined,) = _geometry(blocks).auto_connections
    assert (joined.block, joined.partner) == (2, 7)
    assert Stand(blocks, engine=engine).run(0.5, motors=1).spin == pytest.approx(speed, abs=0.01)


@pytest.mark.parametrize("beside", [[], [(63, 0, 3), (63, 0, 2)]])
def test_touching_neighbours_do_not_rub(engine: EngineSpec, beside: Blocks) -> None:
    """An arm that sweeps over the logs beside its motor keeps its speed."""
    stand = Stand([(22, 0, 4), (63, 1, 2), (63, 1, 1), *beside], engine=engine).run(0.5, motors=1)
    assert stand.run(1.0).spin == pytest.approx(8.0, rel=1e-3)


def test_joined_faces_are_as_strong_as_attached_ones() -> None:
    (loop,) = (joint for joint in Stand([*AXLE, (19, 6, 3)]).assembly.joints if joint.extra)
    assert loop.strength is not None
    assert [loop.strength.force, loop.strength.torque] == facts()["strength"]["usual"]


def test_all_faces_lie_on_a_half_metre_grid() -> None:
    for kind in library().values():
        for face in kind.faces:
            assert [2 * at % 1 for at in face.position] == [0, 0, 0], kind.name


@pytest.mark.parametrize(("load", "after"), [([], 17.7), ([(63, 1, 0)], 11.6)])
def test_a_steering_hinge_slows_down_under_load_and_stops_at_90_degrees(
    engine: EngineSpec, load: Blocks, after: float
) -> None:
    stand = Stand([(28, 0, 0), *load], engine=engine)
    start = stand.world.state().rotation[1]
    angles = [
        _turned(start, stand.run(0.02, steering_hinges=1).world.state().rotation[1])
        for _ in range(60)
    ]
    assert angles[4] == pytest.approx(after, abs=0.1)
    assert max(angles) < 90.1
    assert angles[-1] == pytest.approx(90.0, abs=0.1)


def test_a_steering_hinge_can_be_held_at_any_angle(engine: EngineSpec) -> None:
    stand = Stand([(28, 0, 0)], engine=engine)
    start = stand.world.state().rotation[1]
    there = stand.run(0.3, steering_hinges=0.5).world.state().rotation[1]
    held = stand.run(0.3, steering_hinges=0).world.state().rotation[1]
    assert _turned(start, there) == pytest.approx(25.8, abs=0.1)
    assert _turned(start, held) == pytest.approx(25.8, abs=0.1)


@pytest.mark.parametrize(("kind", "arm"), [(26, 2.1), (55, 1.4)])
def test_blades_of_both_sizes_push_alike_along_their_up_at_their_centre(
    engine: EngineSpec, kind: int, arm: float
) -> None:
    stand = Stand([(22, 0, 4), (kind, 1, 3)], engine=engine).run(0.5, motors=1)
    state = stand.world.state()
    speed = float(np.linalg.norm(state.velocity[2]))
    assert speed == pytest.approx(8.0 * arm, rel=1e-3)
    sideways, lift, _ = stand.reaction(2)[:3]  # the third bears the circular motion
    assert abs(lift) == pytest.approx(facts()["blade"]["lift"] * speed**3, rel=0.025)
    assert abs(sideways) < 1e-3


@pytest.mark.parametrize(
    ("blocks", "turns"),
    [([(63, 0, 3), (63, 0, 2)], 0.0), ([(63, 0, 3), (63, 0, 2), (35, 1, 0)], 0.507)],
)
def test_drag_acts_at_blocks_so_that_those_without_it_turn_a_craft(
    engine: EngineSpec, blocks: Blocks, turns: float
) -> None:
    """rad/s after a fall of 1 s; Ballast has no drag."""
    stand = Stand(blocks, anchored=False, gravity=True, engine=engine).run(1.0)
    assert abs(stand.world.state().angular_velocity[0, 2]) == pytest.approx(turns, abs=0.005)


@pytest.mark.parametrize(
    ("blocks", "yaw", "area"),
    [
        ([], 0, 1.0),
        ([(63, 0, 0)], 0, 4.0),
        ([(63, 0, 0)], 30, 4 * cos(radians(30)) + 0.5 + 0.5),
        ([(15, 0, 3), (15, 0, 2)], 0, 3.0),  # behind one another
        ([(26, 0, 0)], 0, 1.0),
        ([(63, 0, 0), (9, 0, 4, 1, 7), (7, 0, 4, 1, 8)], 0, 4.0),
    ],
)
def test_wind_strikes_the_boxes_of_all_blocks_but_blades_and_two_ended_ones(
    engine: EngineSpec, blocks: Blocks, yaw: float, area: float
) -> None:
    scene = replace(WINDY, start=replace(HIGH.start, yaw=yaw))
    stand = Stand(blocks, scene, anchored=False, engine=engine).run(1 / RATE)
    assert stand.momentum(0) * RATE / 36 / facts()["air"]["wind"] == pytest.approx(area, rel=1e-3)


def test_a_spring_pulls_as_much_more_as_it_is_pulled_apart(engine: EngineSpec) -> None:
    """A motor winds an arm of two logs away from the end of the spring."""
    stand = Stand([(22, 0, 4), (63, 1, 2), (63, 0, 3), (9, 2, 0, 3, 0)], engine=engine)
    stand.run(0.02, springs=1)
    lengths = []
    for _ in range(3):
        stand.run(0.02, motors=1)
        lengths.append(float(stand.world.state().length[0]))
    rate = (lengths[2] - lengths[1]) / 0.02
    assert lengths[2] > 1.0
    pull = float(np.linalg.norm(stand.reaction(4)[:3]))
    assert pull == pytest.approx(facts()["spring"]["pull"] + 10.0 * rate, rel=0.02)


def test_a_winch_does_not_pull_before_its_start(engine: EngineSpec) -> None:
    stand = Stand([(45, 0, 2, 0, 3)], engine=engine)
    assert np.linalg.norm(stand.run(0.2).reaction(1)[:3]) < 1e-9
    assert np.linalg.norm(stand.run(0.4, winches=1).reaction(1)[:3]) > 100.0


def test_a_grabber_holds_a_ball_so_that_it_cannot_turn(engine: EngineSpec) -> None:
    stand = hold_ball(0.01, engine).run(1.0)
    state = stand.world.state()
    assert state.object_position[0, 1] == pytest.approx(3.48, abs=0.01)
    assert abs(state.object_rotation[0]) == pytest.approx([0, 0, 0, 1], abs=1e-3)


@pytest.mark.parametrize(("tilt", "slides"), [(38.0, False), (45.0, True)])
def test_wheels_grip_sideways_as_they_do_forwards(
    engine: EngineSpec, tilt: float, slides: bool
) -> None:
    """On a slope between the tangents 0.78 and 1, with 0.89 between them."""
    start = Start(height=20.0, pitch=tilt)
    middle = (0.0, 20.0 - 0.2 * cos(radians(tilt)), 0.2 * sin(radians(tilt)))
    plane = SceneObject("slope", "box", (60.0, 0.4, 60.0), middle, start.rotation)
    car = [(63, 0, 2), (63, 0, 3), *((40, log, face) for log in (1, 2) for face in (3, 6))]
    scene = Scene((plane,), start=start)
    stand = Stand(car, scene, anchored=False, gravity=True, engine=engine).run(0.3)
    assert (abs(stand.momentum(2)) / stand.mass() > 0.1) == slides


def test_a_ball_of_a_scene_falls_without_drag(engine: EngineSpec) -> None:
    ball = SceneObject("ball", "sphere", (1.0, 1.0, 1.0), (5.0, 200.0, 0.0), mass=2.0)
    stand = Stand([], Scene((ball,)), gravity=True, engine=engine).run(1.0)
    fall = stand.world.state().object_velocity[0, 1]
    assert fall == pytest.approx(-stand.g, rel=1e-3)


def test_a_ball_of_a_scene_rolls_freely(engine: EngineSpec) -> None:
    """Down a slope it gains 5/7 of what it would without turning."""
    tilt = radians(10.0)
    turned = Start(pitch=10.0).rotation
    plane = SceneObject("slope", "box", (60.0, 0.4, 60.0), (0.0, 20.0, 0.0), turned)
    off = 0.2 + 1.5
    place = (5.0, 20.0 + off * cos(tilt), -off * sin(tilt))
    ball = SceneObject("ball", "sphere", (3.0, 3.0, 3.0), place, mass=2.0)
    scene = Scene((plane, ball), start=Start(height=60.0))
    stand = Stand([], scene, gravity=True, engine=engine).run(0.5)
    before = stand.world.state().object_velocity[0]
    gain = float(np.linalg.norm(stand.run(0.5).world.state().object_velocity[0] - before)) / 0.5
    assert gain == pytest.approx(5 / 7 * stand.g * sin(tilt), rel=0.02)


def test_exactly_the_greatest_size_fits() -> None:
    row = [(63, 0, 3), (63, 1, 0), (63, 2, 0), (63, 3, 0), (63, 4, 0), (15, 5, 0)]
    assert _geometry(row).size[0] == 17.0
    assert size_problems(_geometry(row), Limits().size) == []
    assert len(size_problems(_geometry([*row, (15, 6, 0)]), Limits().size)) == 1
