"""What every engine promises, on small machines whose motion is known. See `physics.engine`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.engine import Engine, EngineSpec, TooLargeError, World
from agentflow.env.physics.laws.flight import Thruster
from agentflow.env.physics.laws.tension import Spring, Winch
from agentflow.env.physics.model import (
    Assembly,
    Devices,
    Drive,
    Gripper,
    Joint,
    JointKind,
    Part,
    Shape,
    Strength,
)
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene, SceneObject, Start
from agentflow.machine.geometry.vectors import IDENTITY, Vec3
from tests.env.conftest import MakeEngine

RATE, G = 120.0, 32.81
FOOT = Shape("box", (4.0, 0.5, 4.0))
CUBE = Shape("box", (1.0, 1.0, 1.0))
STRONG = Strength(1e6, 1e6)


def machine(parts: list[Part], joints: list[Joint], **changes: object) -> Assembly:
    """An assembly in which every part is a block of its own."""
    centres = tuple(part.centre for part in parts)
    blocks = tuple((i,) for i in range(len(parts)))
    turns = (IDENTITY,) * len(parts)
    whole = Assembly(tuple(parts), tuple(joints), blocks, centres, centres, turns)
    return replace(whole, **changes)  # type: ignore[arg-type]


def foot() -> Part:
    """A slab on the ground that hardly anything moves."""
    return Part(0, (0.0, 0.25, 0.0), 1e4, (1e4, 1e4, 1e4), (FOOT,), friction=0.8)


def cube(block: int, centre: Vec3, mass: float = 2.0) -> Part:
    moment = mass / 6.0
    return Part(block, centre, mass, (moment,) * 3, (CUBE,), friction=0.8)


def rigid(a: int, b: int, pivot: Vec3) -> Joint:
    return Joint(b, a, a, b, pivot=pivot, strength=STRONG)


def stack() -> Assembly:
    """A foot, a cube above it and one that sticks out to the right of that."""
    return machine(
        [foot(), cube(1, (0.0, 2.0, 0.0)), cube(2, (1.0, 2.0, 0.0), 3.0)],
        [rigid(0, 1, (0.0, 0.5, 0.0)), rigid(1, 2, (0.5, 2.0, 0.0))],
    )


def arm(kind: JointKind = "revolute", drive: Drive | None = None) -> Assembly:
    """A bar that turns about the upright axis of a foot, with a cube at its end."""
    bar = Part(1, (0.0, 3.0, 0.0), 2.0, (0.2, 1.0, 1.0), (Shape("box", (2.0, 0.2, 0.2)),))
    axle = Joint(1, 0, 0, 1, kind, (0.0, 3.0, 0.0), (0.0, 1.0, 0.0), STRONG)
    return machine(
        [foot(), bar, cube(2, (1.5, 3.0, 0.0))],
        [replace(axle, drive=drive or Drive()), rigid(1, 2, (1.0, 3.0, 0.0))],
    )


MOTOR = Drive(speed=4.0, torque=500.0)


def run(world: World, steps: int) -> None:
    for _ in range(steps):
        world.step()


def everything(world: World) -> bytes:
    """Every bit that can be seen of a world."""
    seen = [*vars(world.state()).values(), world.reactions, *world.momentum().values()]
    return b"".join(np.ascontiguousarray(value).tobytes() for value in seen)


BALL = SceneObject("ball", "sphere", (1.0, 1.0, 1.0), (0.3, 4.5, 0.2), mass=1.0)
PILLAR = SceneObject("pillar", "box", (1.0, 2.0, 1.0), (6.0, 1.0, 0.0))


def played(engine: Engine) -> bytes:
    """A motor, contacts, wind and a split."""
    world = engine.build(arm(drive=MOTOR), Scene((PILLAR, BALL), wind=(1.0, 0.0, -3.0)), RATE)
    run(world, 30)
    world.switch("motors", 1.0)
    run(world, 60)
    world.split([1])
    run(world, 60)
    return everything(world)


# --- determinism ---------------------------------------------------------------------------


def test_equal_calls_give_equal_bits_whatever_was_built_before(make_engine: MakeEngine) -> None:
    engine, other = make_engine(None), make_engine(None)
    first = played(engine)
    assert played(engine) == first
    run(engine.build(stack(), Scene((PILLAR,)), 240.0), 50)
    assert played(engine) == first
    run(other.build(stack(), Scene((BALL,)), RATE), 7)
    assert played(other) == first


def test_looking_changes_nothing(engine: Engine) -> None:
    seen = []
    for look in (False, True):
        world = engine.build(arm(drive=MOTOR), Scene((BALL,)), RATE)
        world.switch("motors", 1.0)
        for _ in range(90):
            world.step()
            if look:
                world.snapshot(), world.contacts(), world.works(), world.energies(world.snapshot())
                world.speeds(thorough=False), world.speeds(), world.touching(0), world.centres()
                world.state(), world.momentum(), world.rotation(2), world.centre("ball")
        seen.append(everything(world))
    assert seen[0] == seen[1]


# --- motion --------------------------------------------------------------------------------


def test_free_fall(engine: Engine) -> None:
    world = engine.build(machine([cube(0, (0.0, 50.0, 0.0))], []), Scene(), RATE)
    run(world, 120)
    assert world.state().velocity[0].tolist() == pytest.approx([0.0, -G, 0.0], rel=1e-6, abs=1e-9)
    fallen = 50.0 - world.centre(0)[1]
    assert fallen == pytest.approx(G / 2, abs=G / RATE)  # an integrator may be a step off
    assert world.centre(0)[::2] == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("level", [1.0, -0.5])
def test_a_motor_reaches_its_speed_about_its_axis(engine: Engine, level: float) -> None:
    """Positive turns take z+ to x+ about y+, as the game's left-handed frame has it."""
    world = engine.build(arm(drive=MOTOR), Scene(), RATE)
    run(world, 30)
    assert world.state().angular_velocity[1] == pytest.approx([0, 0, 0], abs=0.01)
    world.switch("motors", level)
    run(world, 60)
    spin = level * MOTOR.speed
    state = world.state()
    assert state.angular_velocity[1] == pytest.approx([0.0, spin, 0.0], rel=0.01, abs=0.01)
    x, _, z = state.centre[2]
    assert state.velocity[2] == pytest.approx([spin * z, 0.0, -spin * x], rel=0.02, abs=0.05)
    world.switch("motors", 0.0)
    run(world, 60)
    assert world.state().angular_velocity[1] == pytest.approx([0, 0, 0], abs=0.01)


@pytest.mark.parametrize("broken", [[1], [0], [0, 1]])
def test_a_split_keeps_momentum_energy_and_places(engine: Engine, broken: list[int]) -> None:
    world = engine.build(arm(drive=MOTOR), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 60)
    before, places = world.momentum(), world.state()
    world.split(broken)
    after, same = world.momentum(), world.state()
    for name, value in before.items():
        assert np.abs(after[name] - value).max() <= 1e-10 * np.abs(value).max()
    for name, value in vars(places).items():
        assert getattr(same, name) == pytest.approx(value, abs=1e-9)


def test_what_broke_off_falls(engine: Engine) -> None:
    world = engine.build(stack(), Scene(), RATE)
    run(world, 30)
    world.split([1])
    run(world, 60)
    assert world.centre(2)[1] == pytest.approx(1.0, abs=0.1)
    assert world.centre(1)[1] == pytest.approx(2.0, abs=0.02)


# --- loads ---------------------------------------------------------------------------------


def settled(engine: Engine, assembly: Assembly, scene: Scene | None = None) -> Array:
    """Mean reactions over half a second, after a second."""
    world = engine.build(assembly, scene or Scene(), RATE)
    run(world, 120)
    total = np.zeros_like(world.reactions)
    for _ in range(60):
        world.step()
        total += world.reactions
    return np.asarray(total / 60)


@pytest.mark.parametrize("yaw", [0.0, 90.0, 200.0])
def test_joints_of_a_stack_bear_the_weight_above(engine: Engine, yaw: float) -> None:
    """Force up; torque about z+ of what sticks out to x+; in the machine's axes, however it stands
    in the world."""
    found = settled(engine, stack(), Scene(start=Start(yaw=yaw)))
    near = pytest.approx
    assert found[0] == near([0, 5 * G, 0, 0, 0, 3 * G * 1.0], rel=0.01, abs=0.05 * G)
    assert found[1] == near([0, 3 * G, 0, 0, 0, 3 * G * 0.5], rel=0.01, abs=0.05 * G)


def test_reactions_are_what_a_exerts_on_b_whichever_hangs_on_the_other(engine: Engine) -> None:
    """A joint whose `a` is above `b`, which therefore carries it: the weight presses down."""
    upside = machine(
        [foot(), cube(1, (0.0, 1.0, 0.0))],
        [Joint(0, 1, 1, 0, pivot=(0.0, 0.5, 0.0), strength=STRONG)],
    )
    assert settled(engine, upside)[0] == pytest.approx(
        [0, -2 * G, 0, 0, 0, 0], rel=0.01, abs=0.05 * G
    )


def test_rigid_joints_that_close_loops_bear_nothing(engine: Engine) -> None:
    whole = stack()
    doubled = replace(whole, joints=(*whole.joints, rigid(0, 2, (0.5, 0.5, 0.0))))
    found = settled(engine, doubled)
    assert not found[2].any()
    assert found[0] == pytest.approx(settled(engine, whole)[0], rel=0.01, abs=0.05 * G)


def test_a_hanging_part_pulls_at_its_ball_joint(engine: Engine) -> None:
    post = Part(1, (0.0, 3.0, 0.0), 2.0, (1.0, 0.2, 1.0), (Shape("box", (0.2, 5.0, 0.2)),))
    bob = Part(2, (2.0, 4.0, 0.0), 3.0, (0.5,) * 3, (CUBE,))
    hanging = machine(
        [foot(), post, bob],
        [
            rigid(0, 1, (0.0, 0.5, 0.0)),
            Joint(2, 1, 1, 2, "spherical", (2.0, 5.0, 0.0), strength=STRONG),
        ],
    )
    found = settled(engine, hanging)
    assert found[1] == pytest.approx([0, 3 * G, 0, 0, 0, 0], rel=0.01, abs=0.05 * G)
    assert found[0] == pytest.approx([0, 5 * G, 0, 0, 0, 3 * G * 2.0], rel=0.01, abs=0.05 * G)


# --- contacts, objects, grips ---------------------------------------------------------------


def test_what_touches_what(engine: Engine) -> None:
    ball = replace(BALL, position=(0.0, 2.0, 0.0))
    far = replace(BALL, name="far", position=(20.0, 9.0, 0.0))
    lone = machine([foot(), cube(1, (0.0, 1.0, 0.0))], [rigid(0, 1, (0.0, 0.5, 0.0))])
    world = engine.build(lone, Scene((ball, far, PILLAR)), RATE)
    run(world, 30)
    assert world.touching("ball") == {1}
    assert world.touching(1) == {"ball"}
    assert world.touching(0) == {"ground"}
    assert world.touching("far") == frozenset()


def test_objects_are_where_they_are_put_and_move_if_they_can(engine: Engine) -> None:
    world = engine.build(stack(), Scene((PILLAR, BALL)), RATE)
    assert len(world.state().object_position) == 1
    assert world.centre("ball") == pytest.approx(BALL.position)
    assert world.centre("pillar") == pytest.approx(PILLAR.position)
    run(world, 12)
    assert world.centre("pillar") == pytest.approx(PILLAR.position)
    assert world.rotation("pillar") == pytest.approx(IDENTITY)
    state = world.state()
    assert state.object_velocity[0].tolist() == pytest.approx([0.0, -G / 10, 0.0], abs=1e-6)
    assert state.object_position[0].tolist() == pytest.approx(world.centre("ball"))


def test_a_gripper_holds_what_touches_its_front_until_it_lets_go(engine: Engine) -> None:
    """High above the ground beside a ball, which stays where it is."""
    hand = Part(1, (0.0, 6.0, 0.0), 1.0, (0.2,) * 3, (CUBE,))
    grips = (Gripper(1, (1.0, 0.0, 0.0), reach=0.5, force=1e4, joined=frozenset({0, 1})),)
    arm = [rigid(0, 1, (0.0, 0.5, 0.0))]
    holding = machine([foot(), hand], arm, devices=Devices(grippers=grips))
    ball = replace(BALL, position=(1.0, 6.0, 0.0))
    world = engine.build(holding, Scene((ball,)), RATE)
    run(world, 120)
    assert world.centre("ball") == pytest.approx((1.0, 6.0, 0.0), abs=0.05)
    world.split([])
    run(world, 30)
    assert world.centre("ball") == pytest.approx((1.0, 6.0, 0.0), abs=0.05)
    world.switch("grabbers", 0.0)
    run(world, 24)
    assert 6.0 - world.centre("ball")[1] == pytest.approx(G * 0.2**2 / 2, rel=0.15)


# --- what is recorded ----------------------------------------------------------------------


def test_states_have_their_shapes_and_agree_with_single_looks(engine: Engine) -> None:
    world = engine.build(arm(drive=MOTOR), Scene((BALL, PILLAR)), RATE)
    world.switch("motors", 1.0)
    run(world, 40)
    state = world.state()
    shapes = {name: value.shape for name, value in vars(state).items()}
    assert shapes == {
        "position": (3, 3),
        "centre": (3, 3),
        "rotation": (3, 4),
        "velocity": (3, 3),
        "angular_velocity": (3, 3),
        "length": (0,),
        "object_position": (1, 3),
        "object_rotation": (1, 4),
        "object_velocity": (1, 3),
    }
    assert {value.dtype for value in vars(state).values()} == {np.dtype(np.float64)}
    assert (world.centres() == state.centre).all()
    for block in range(3):
        assert world.centre(block) == pytest.approx(state.centre[block])
        assert world.origin(block) == pytest.approx(state.position[block])
        assert world.rotation(block) == pytest.approx(state.rotation[block])


def test_snapshots_are_the_states_of_their_times_also_across_a_split(engine: Engine) -> None:
    world = engine.build(arm(drive=MOTOR), Scene((BALL,)), RATE)
    states, snapshots = [], []
    for step in range(6):
        run(world, 10)
        snapshots.append(world.snapshot())
        states.append(vars(world.state()))
        if step == 3:
            world.split([1])
    kept = vars(world.states(snapshots))
    for name, values in kept.items():
        assert (values == np.array([state[name] for state in states])).all()


def test_a_quick_look_at_speeds_is_never_above_a_thorough_one(engine: Engine) -> None:
    world = engine.build(arm(drive=MOTOR), Scene((BALL,)), RATE)
    world.switch("motors", 1.0)
    for _ in range(60):
        world.step()
        for quick, thorough in zip(world.speeds(thorough=False), world.speeds(), strict=True):
            assert quick <= thorough
    state = world.state()
    assert world.speeds()[1] >= 0.99 * MOTOR.speed
    assert world.speeds()[0] >= np.linalg.norm(state.velocity, axis=1).max() * (1 - 1e-9)


def test_divergence_is_seen(engine: Engine) -> None:
    push = Devices(thrusters=(Thruster(0, (0.0, 1e200, 0.0)),))
    world = engine.build(machine([cube(0, (0.0, 5.0, 0.0))], [], devices=push), Scene(), RATE)
    world.switch("motors", 1.0)
    run(world, 3)
    for thorough in (False, True):
        assert not world.speeds(thorough)[0] <= constants()["speed_limit"]


# --- engines -------------------------------------------------------------------------------


def test_an_engine_has_the_identity_that_is_registered(
    engine: Engine, engine_spec: EngineSpec
) -> None:
    assert engine.identity == engine_spec.identity
    assert str(engine.identity).startswith(f"{engine_spec.name} ")


def row_of_cubes(count: int) -> Assembly:
    return machine(
        [cube(i, (float(i), 0.5, 0.0)) for i in range(count)],
        [rigid(i, i + 1, (i + 0.5, 0.5, 0.0)) for i in range(count - 1)],
    )


def test_a_piece_that_is_too_large_is_refused_with_the_registered_limit(
    engine: Engine, engine_spec: EngineSpec
) -> None:
    limit = engine_spec.most_parts
    if limit is None:
        run(engine.build(row_of_cubes(300), Scene(), RATE), 2)
    else:
        run(engine.build(row_of_cubes(limit), Scene(), RATE), 2)
        with pytest.raises(TooLargeError) as caught:
            engine.build(row_of_cubes(limit + 1), Scene(), RATE)
        found = f"{limit + 1} parts in one piece; {engine.identity.name} holds at most {limit}"
        assert found in caught.value.problem.message
    run(engine.build(stack(), Scene(), RATE), 2)


def test_an_engine_may_be_closed_twice(make_engine: MakeEngine) -> None:
    engine = make_engine(None)
    run(engine.build(stack(), Scene(), RATE), 2)
    engine.close()
    engine.close()


# --- measuring -----------------------------------------------------------------------------


def test_contacts_of_what_rests_press_with_its_weight(engine: Engine) -> None:
    ball = replace(BALL, position=(0.0, 2.0, 0.0))
    lone = machine([foot(), cube(1, (0.0, 1.0, 0.0))], [rigid(0, 1, (0.0, 0.5, 0.0))])
    world = engine.build(lone, Scene((ball, PILLAR)), RATE)
    run(world, 240)
    found = {(touch.a, touch.b): touch for touch in world.contacts()}
    assert set(found) == {(0, "ground"), (1, "ball")}
    mass = sum(part.mass for part in lone.parts)
    assert found[1, "ball"].force == pytest.approx(G, rel=0.02)
    assert found[0, "ground"].force == pytest.approx((mass + 1.0) * G, rel=0.02)
    assert found[1, "ball"].place == pytest.approx((0.0, 1.5, 0.0), abs=0.02)


def test_energies_are_those_of_blocks_and_things(engine: Engine) -> None:
    world = engine.build(arm(drive=MOTOR), Scene((BALL,)), RATE)
    world.switch("motors", 1.0)
    run(world, 12)
    found = world.energies(world.snapshot())
    assert found.shape == (4, 2)
    assert found[:3, 0].sum() == pytest.approx(float(world.momentum()["energy"][0]))
    state = world.state()
    speed = np.linalg.norm(state.object_velocity[0])
    assert found[3, 0] == pytest.approx(0.5 * speed**2, rel=0.02)
    assert found[3, 1] == pytest.approx(G * state.object_position[0, 1])


def test_the_work_of_a_motor_is_its_torque_times_its_speed(engine: Engine) -> None:
    world = engine.build(arm(drive=replace(MOTOR, speed=1e3, torque=50.0)), Scene(), RATE)
    assert world.works().tolist() == [[0.0, 0.0, 0.0]]
    world.switch("motors", 1.0)
    run(world, 30)
    spin = abs(world.state().angular_velocity[1, 1])
    world.step()
    mean = (spin + abs(world.state().angular_velocity[1, 1])) / 2
    works = world.works()
    assert works.shape == (32, 3)
    assert works[-1, 1] - works[-2, 1] == pytest.approx(50.0 * mean / RATE, rel=0.02)


def test_the_work_of_a_spring_is_what_it_swings(engine: Engine) -> None:
    """Also after it has swung fast to and fro: no error adds up."""
    swung = arm()
    spring = Spring(3, 2, natural=1.0, ramp=1.0, force=1000.0, damping=0.0)
    parts = [*swung.parts, cube(3, (3.0, 3.0, 4.0))]
    joints = [*swung.joints, rigid(0, 3, (2.0, 0.5, 2.0))]
    world = engine.build(machine(parts, joints, devices=Devices(springs=(spring,))), Scene(), RATE)
    world.switch("springs", 1.0)
    for _ in range(8):
        run(world, 6)
        kinetic = world.energies(world.snapshot())[:, 0].sum()
        assert world.works()[-1, 0] == pytest.approx(kinetic, rel=0.01, abs=5.0)


def test_the_work_of_a_winch_moves_what_it_pulls(engine: Engine) -> None:
    """Two blocks fall, and a rope pulls them together, while something else breaks."""
    parts = [cube(i, (3.0 * i, 50.0, 0.0)) for i in range(3)]
    rope = Winch(0, 1, speed=5.0, shortest=0.5, stiffness=1500.0, damping=15.0, force=600.0)
    held = machine(parts, [rigid(1, 2, (4.5, 50.0, 0.0))], devices=Devices(winches=(rope,)))
    world = engine.build(held, Scene(), RATE)
    start = world.energies(world.snapshot()).sum()
    world.switch("winches", 1.0)
    run(world, 15)
    world.split([0])
    run(world, 15)
    works = world.works()
    assert works.shape == (31, 3)
    assert works[-1, 1] > 5.0
    gained = world.energies(world.snapshot()).sum() - start
    # engines move bodies by their velocity after each step, so they fall half a step too far
    further = sum(part.mass for part in parts) * G * (G * 30 / RATE) / (2 * RATE)
    assert works[-1].sum() == pytest.approx(gained + further, rel=0.02)
