"""Breaks: what a split keeps, several at once, breaks of breaks, the same at every rate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.assembly import assemble
from agentflow.env.physics.engine import Engine, World
from agentflow.env.physics.engines import default_engine
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.registry import ENGINES
from agentflow.env.physics.structure.spanning_tree import skeleton
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Broken, Rollout
from agentflow.env.scene import Scene, Start
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Machine
from benchmarks.shelf import load, read
from tests.env.machines import BALLASTED, SHIPPED, machine, shipped, task_of
from tests.env.test_statics import FOOT, SWING


def start(engine: Engine, tree: Machine, wind: float = 0.0) -> tuple[World, Assembly]:
    """The machine in full motion, 0.4 s after everything was switched on."""
    assembly = assemble(tree, place(tree), constants())
    world = engine.build(assembly, Scene(wind=(wind, 0.0, 0.3 * wind)), 120.0)
    for step in range(72):
        for entry in ("motors", "springs", "steering_hinges") if step == 24 else ():
            world.switch(entry, True)
        world.step()
    return world, assembly


def part(world: World, joints: Sequence[int], close: float = 1e-10) -> None:
    """Split, and see that everything goes on as it was."""
    before, state = world.momentum(), world.state()
    world.split(joints)
    after, same = world.momentum(), world.state()
    for name, value in before.items():
        assert np.abs(after[name] - value).max() <= close * np.abs(value).max()
    for name in ("position", "centre", "velocity", "angular_velocity", "length"):
        scale = max(1.0, np.abs(getattr(state, name)).max(initial=0.0))
        assert np.abs(getattr(same, name) - getattr(state, name)).max(initial=0.0) <= close * scale
    turned = np.abs((same.rotation * state.rotation).sum(axis=1))
    assert turned.tolist() == pytest.approx([1.0] * len(turned), abs=close)


FLAIL = machine(
    *FOOT,
    (63, 0, 4),
    (22, 5, 0),
    (63, 6, 1),
    (44, 7, 0),
    (15, 8, 0),
    (5, 9, 0),
    (35, 10, 0),
    (63, 6, 2),
    (76, 12, 0),
    (35, 13, 0),
    (9, 7, 8, 12, 7),
    (7, 6, 0, 12, 8),
)
"""Arms that swing ballast on ball joints and a hinge, a spring between them, one of them braced."""
CREEPER = machine(
    (0, -1, -1),
    (16, 0, 0),
    (1, 1, 0),
    (2, 2, 2),
    (2, 2, 4),
    (50, 0, 1),
    (28, 0, 4),
    (63, 6, 0),
    (9, 7, 7, 2, 5),
)
"""A suspension, driven wheels, a caster, a log on a steering hinge that a spring holds."""


@pytest.mark.parametrize("tree", [BALLASTED, FLAIL, CREEPER], ids=["throw", "flail", "creeper"])
def test_every_joint_can_go_in_mid_motion(engine: Engine, tree: Machine) -> None:
    """One after the other, each from what the earlier ones left."""
    world, assembly = start(engine, tree, 10.0)
    order = np.random.default_rng(1).permutation(len(assembly.joints)).tolist()
    for joint in order:
        part(world, [joint])
        world.step()
        world.step()
    assert len(world.state().position) == len(tree)


@pytest.mark.parametrize("tree", [BALLASTED, FLAIL, CREEPER], ids=["throw", "flail", "creeper"])
def test_several_joints_can_go_in_one_step(engine: Engine, tree: Machine) -> None:
    world, assembly = start(engine, tree, 10.0)
    order = np.random.default_rng(2).permutation(len(assembly.joints)).tolist()
    for few in range(0, len(order), 4):
        part(world, order[few : few + 4])
        world.step()


def test_a_loop_takes_over_where_a_moving_joint_goes(engine: Engine) -> None:
    """The seat of the swing, blown aside, then hangs on the other hinges, as it was but for what
    the solver left open in the loop."""
    world, assembly = start(engine, machine(*SWING), 25.0)
    assert abs(world.state().angular_velocity[15]).max() > 0.05
    (loop,) = skeleton(len(assembly.parts), assembly.joints).loops
    gone = [i for i, joint in enumerate(assembly.joints) if joint.block == 13]
    assert loop.joint not in gone
    part(world, gone, 1e-4)


DROPPED = machine(
    *((0, -1, -1), (35, 0, 4), (63, 0, 2), (63, 2, 0), (35, 3, 0), (35, 4, 0)),
    *((63, 0, 3), (63, 6, 0), (35, 7, 0), (35, 8, 0)),
)
"""Two long arms with ballast at their tips."""


@pytest.mark.pybullet
@pytest.mark.parametrize("rate", [60, 120, 240, 480])
def test_an_impact_passes_whole_through_a_connection_that_it_breaks(rate: float) -> None:
    """The arms, which fall 10 m, stop in one step, however short: the connection at their middle
    passes several times the angular momentum that it bears within the load window. (MuJoCo's
    contacts take several steps, in which another connection breaks.)"""
    engine, value = ENGINES["pybullet"].start(), constants()
    assembly = assemble(DROPPED, place(DROPPED), value)
    world = engine.build(assembly, Scene(start=Start(height=10.0)), rate)
    loads = Loads(assembly.joints, value["load_window"], 1 / rate, 1 / value["step_rate"])
    broken: dict[int, float] = {}
    while not broken:
        falling = world.state().velocity[9, 1]
        world.step()
        broken = loads.update(world.reactions)
    index, load = next(iter(broken.items()))
    assert assembly.joints[index].block == 7
    strength = assembly.joints[index].strength
    assert strength is not None
    passed = np.linalg.norm(world.reactions[index, 3:]) / rate
    share = passed / (strength.torque * value["load_window"])
    window = max(1 / rate, 1 / value["step_rate"]) / value["load_window"]
    assert load == pytest.approx(share * (1 - np.exp(-window)) / window, rel=0.02)
    assert 5.0 < share < 7.0
    assert falling == pytest.approx(-25.3, abs=0.1)
    assert -6.0 < world.state().velocity[9, 1] < -2.0
    engine.close()


def broken_at(name: str, rate: float) -> tuple[Broken, ...]:
    tree = shipped(name)
    return simulate(tree, task_of(tree, window=1), rate=rate).broken


BREAKING = {
    "published_throw": {(8, 7)},
    "unballasted_throw": {(8, 7)},
    "springy_throw": {(8, 7)},
    "braced_throw": {(1, 0)},
    "rotor_with_ballast": {(10, 9), (1, 0)},  # one impact overloads the whole arm
    "rotor_of_rods": {(10, 9)},
}
"""Block and partner of the connections of which one breaks first."""


RATES = (60, 120, 240, 480)
NEAR = 0.025
"""s."""
DRIFT = 0.03
"""Share of the time until then that late impacts may be apart, as the motion before them is."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED)
def test_break_times_do_not_hang_on_the_rate(name: str) -> None:
    found = [broken_at(name, rate) for rate in RATES]
    if name not in BREAKING:
        assert found == [()] * len(RATES)
        return
    assert {(broken[0].block, broken[0].partner) for broken in found} <= BREAKING[name]
    times = [broken[0].time for broken in found]
    assert max(times) - min(times) <= NEAR


REFERENCES = {
    item.machine: item.level
    for family in ("throwing", "jumping")
    for item in read(family).references
}
"""The families whose references tear themselves apart, and a level of each machine."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "level"), REFERENCES.items())
def test_references_break_first_at_nearly_the_same_time(name: str, level: str) -> None:
    """From 120 Hz on; at 60 Hz a step more, in which the break is noticed."""
    trial = get_task(level).trials(0)[0]
    found = [simulate(load(name), trial, rate=rate).broken for rate in RATES]
    if not all(found):
        assert found == [()] * len(RATES)
        return
    coarse, *times = (broken[0].time for broken in found)
    near = max(NEAR, DRIFT * min(times))
    assert max(times) - min(times) <= near
    assert max(*times, coarse) - min(*times, coarse) <= near + 1 / 60


def test_braces_save_the_top_of_the_tower() -> None:
    def pairs(name: str) -> set[tuple[int, int]]:
        return {(broken.block, broken.partner) for broken in broken_at(name, 120)}

    assert (8, 7) in pairs("published_throw")
    assert (8, 7) not in pairs("braced_throw")


@pytest.fixture(scope="module")
def ruin() -> Rollout:
    """The published machine with connections of 7 % of their strength."""
    weak = constants().changed({"strength_torque": 350.0, "strength_force": 1050.0})
    return simulate(BALLASTED, task_of(BALLASTED, window=2), physics=weak)


@pytest.mark.slow
def test_what_broke_off_breaks_again(ruin: Rollout) -> None:
    assert len(ruin.broken) >= 4
    assert len({(broken.block, broken.partner) for broken in ruin.broken}) == len(ruin.broken)
    loose: set[int] = set()
    again = []
    for broken in ruin.broken:
        if broken.partner in loose:
            again.append(broken.block)
        loose.add(broken.block)
        for step in BALLASTED:
            if step.parent in loose:
                loose.add(step.id)
    assert again


@pytest.mark.slow
def test_several_connections_break_in_one_step(ruin: Rollout) -> None:
    times = [broken.time for broken in ruin.broken]
    assert len(set(times)) < len(times)
    assert times == sorted(times)
    trace = ruin.trace
    assert trace is not None
    assert np.isfinite(trace.position).all()
    for broken in ruin.broken:
        column = trace.connections.index((broken.block, broken.partner))
        gone = trace.times > broken.time
        assert np.isnan(trace.utilisation[gone, column]).all()
        assert not np.isnan(trace.utilisation[~gone, column]).any()


def test_what_closes_a_loop_can_break(engine: Engine) -> None:
    world, assembly = start(engine, machine(*SWING), 25.0)
    (loop,) = skeleton(len(assembly.parts), assembly.joints).loops
    assert np.abs(world.reactions[loop.joint]).max() > 10.0
    part(world, [loop.joint], 1e-4)
    world.step()
    assert not world.reactions[loop.joint].any()


def test_what_breaks_while_settling_is_told_with_its_negative_time() -> None:
    """A beam with a ballast at its end, too weak for its own weight."""
    weak = constants().changed({"strength_torque": 20.0, "strength_force": 100.0})
    engine = default_engine().start(weak)
    beam = machine((0, -1, -1), (15, 0, 4), (63, 1, 1), (35, 2, 0))
    rollout = simulate(beam, get_task("movement", {"window": 1}), engine=engine, physics=weak)
    engine.close()
    first = rollout.broken[0]
    assert first.time < 0.0
    assert (
        f"off block {first.partner} at {first.time:.2f} s (while it settled, before t = 0), load"
        in rollout.feedback.text
    )
    assert rollout.feedback.data["broken"][0]["time"] == first.time
    query = {"id": first.block, "duration": [-1, 1], "properties": ["position"]}
    assert "while the machine settled" in answer_queries(beam, rollout, [query]).text
