"""The transport referee on hand-made ways, where cargo falls from, and the reference machines on
real physics with both engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.feedback.text import steering_angles
from agentflow.env.physics.engine import EngineSpec
from agentflow.env.physics.engines import installed_engines
from agentflow.env.rollout import Verdict
from agentflow.env.rotations import compose
from agentflow.env.scene import Body
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.transport import CARGO
from agentflow.env.tasks.registry import get_level, get_task
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.controls import control_problems
from agentflow.machine.geometry import placement
from agentflow.machine.geometry.vectors import Vec3, about_axis
from agentflow.machine.tree import Control, Machine
from benchmarks.shelf import load
from tests.env.fakes import FakeWorld, make_trace
from tests.env.machines import machine
from tests.llm.procedural.asking import brief_of, whole_design

ON: frozenset[Body] = frozenset({0})
FALLEN: frozenset[Body] = frozenset({0, "ground"})
START: Vec3 = (0.5, 2.0, -0.5)
"""Where the cargo, and the only block, are at t = 0."""
Look = tuple[Vec3, frozenset[Body]]


def judge(task: str, *looks: Look, block: tuple[Vec3, ...] = (), whole: bool = True) -> Verdict:
    """Let the referee see these places and contacts of the cargo, 1 s apart.

    Args:
        task: The level.
        looks: What it sees.
        block: Places of the block at the same times; those of the cargo by default.
        whole: Whether the block holds on to its parent.
    """
    referee = get_task(task).referee(LONE_ROOT)
    world = FakeWorld(centres={CARGO: START, 0: START}, contacts={CARGO: ON})
    referee.start(world)
    for place, contacts in looks:
        world.time += 1.0
        world.centres |= {CARGO: place, 0: place}
        world.contacts[CARGO] = contacts
        referee.watch(world)
    path = [START, *(block or [place for place, _ in looks])]
    alive = np.full((len(path), 1), whole)
    return referee.verdict(make_trace(1, len(path), 1.0, {0: path}, alive=alive))


def at(right: float, ahead: float, contacts: frozenset[Body] = ON) -> Look:
    return (START[0] + right, 2.0, START[2] + ahead), contacts


def test_the_distance_from_the_target_counts_and_arrival_counts_as_much() -> None:
    near = judge("transport/2", at(10, 8))
    assert (near.score, near.terms["success"]) == (8.0, False)
    there = judge("transport/2", at(5, 5), at(10, 9.5))
    assert there.score == 19.5
    assert there.terms == {
        "distance": 0.5,
        "success": True,
        "intact": True,
        "deviation": pytest.approx(0.5 / 2**0.5),
        "time": 2.0,
        "turned": None,
        "lost_at": None,
        "result": "arrived: within 1.00 m since 2.00 s, 0.50 m from the target at the end, intact",
    }
    broken = judge("transport/2", at(10, 9.5), whole=False)
    assert (broken.score, broken.terms["success"]) == (9.5, True)


def test_what_stands_still_or_leaves_the_target_again_earns_less() -> None:
    assert judge("transport/2", at(0, 0)).score == 0.0
    assert judge("transport/3", at(0, 0)).score == 0.0
    passed = judge("transport/2", at(10, 10), at(10, 14))
    assert (passed.score, passed.terms["time"]) == (6.0, None)


def test_a_cargo_that_touches_the_ground_stays_there_for_the_score() -> None:
    verdict = judge("transport/2", at(6, 10), at(8, 10, FALLEN), at(10, 10))
    assert verdict.score == 6.0
    assert verdict.terms["lost_at"] == 2.0
    assert verdict.terms["result"] == (
        "the cargo touched the ground at 2.00 s, 4.00 m from the target"
    )
    assert [event.kind for event in verdict.events] == ["cargo_lost"]


def test_a_cargo_that_flies_is_not_carried() -> None:
    assert judge("transport/2", at(6, 10), at(10, 10, frozenset())).score == 6.0


def test_the_machine_must_come_along() -> None:
    verdict = judge("transport/2", at(5, 5), at(10, 10), block=(START, START))
    assert (verdict.score, verdict.terms["success"]) == (0.0, False)
    assert "a block stayed behind" in str(verdict.terms["result"])


def test_there_and_back_counts_half_of_what_is_left() -> None:
    half = judge("transport/3", at(10, 10))
    assert half.score == pytest.approx(10 - 200**0.5 / 2)
    assert half.terms["turned"] == 1.0
    whole = judge("transport/3", at(10, 10), at(0, 0.5))
    assert whole.score == 19.75
    assert whole.terms["success"] is True
    assert judge("transport/3", at(5, 5), at(0, 0)).score == 0.0
    home = (START[0] + 10, 2.0, START[2] + 10)
    thrown = judge("transport/3", at(10, 10), at(0, 0), block=(home, home))
    assert thrown.score == half.score


def test_the_cargo_falls_from_its_height_or_from_the_machine() -> None:
    task = get_task("transport/2")
    tower = machine((0, -1, -1), (63, 0, 4), (63, 1, 0))
    for tree, under in ((LONE_ROOT, 3.5), (tower, 7.0)):
        (cargo,) = task.scene(tree).moving
        assert cargo.position == (0.0, under + 0.75, 0.0)
    assert task.scene().moving[0].size == (2.5, 1.5, 2.5)


def test_a_mark_that_nothing_can_touch_shows_the_target() -> None:
    (mark,) = get_task("transport", {"target.right": -6}).scene(LONE_ROOT).objects
    assert mark.position[::2] == (-6.0, 10.0)
    assert mark.position[1] + mark.size[1] / 2 < 0.0


def test_no_machine_starts_in_the_wall_or_on_uneven_ground() -> None:
    lengths = [get_task(f"transport/{n}").brief.limits.size[2] for n in (3, 4, 5)]
    assert lengths == [17.0, 9.5, 9.5]
    open_ground = get_task("transport/5", {"wall.height": 0})
    assert open_ground.brief.limits.size[2] == 12.0


@pytest.mark.slow
async def test_the_procedural_designer_steers_and_stops() -> None:
    brief = brief_of("transport/2")
    made = await whole_design(brief, 3)
    assert made is not None
    program = {each.target: each for each in made.machine.controls}
    assert program["steering_hinges"].level < 0.0
    assert program["motors"].lasts < 10.0
    assert control_problems(made.machine) == []


def without_controls(tree: Machine) -> Machine:
    return Machine(tree.steps)


@pytest.mark.slow
@pytest.mark.parametrize("spec", installed_engines(), ids=lambda spec: spec.name)
def test_a_car_steers_to_the_target_on_both_engines(spec: EngineSpec) -> None:
    task = replace(get_task("transport"), engine=spec.name)
    tree = load("transport/steered_car.json")
    rollout = simulate(tree, task)
    assert rollout.terms["success"] is True, rollout.feedback.text
    assert simulate(without_controls(tree), task).terms["success"] is False
    assert "Result: arrived: within" in rollout.feedback.text


@pytest.mark.slow
@pytest.mark.parametrize("spec", installed_engines(), ids=lambda spec: spec.name)
def test_a_carrier_keeps_its_cargo_on_both_engines(spec: EngineSpec) -> None:
    """Wheels roll out differently, so it ends up to 2 m off where it was not tried out."""
    rollout = simulate(
        load("transport/carrier_there.json"), replace(get_task("transport/2"), engine=spec.name)
    )
    assert (rollout.terms["lost_at"], rollout.terms["intact"]) == (None, True)
    assert rollout.score is not None
    assert rollout.score > 8.0


STEERED = Machine(
    machine(
        (0, -1, -1), (63, 0, 0), (63, 0, 1), (28, 1, 3), (28, 1, 6), (13, 2, 3), (13, 2, 9)
    ).steps,
    tuple(Control((block,), 0.0, 0.25, 1.0) for block in (3, 5, 6)),
)
"""Steering hinges on both sides in front, steering blocks at the side and on top behind."""


@pytest.mark.parametrize("spec", installed_engines(), ids=lambda spec: spec.name)
def test_feedback_tells_how_far_everything_has_steered(spec: EngineSpec) -> None:
    """At full speed, 3 rad/s, for 0.25 s, in the sense of level 1; block 4 is not driven."""
    task = replace(get_task("transport", {"window": 1}), engine=spec.name)
    feedback = simulate(STEERED, task).feedback
    lines = [line for line in feedback.text.splitlines() if line.startswith("Steering")]
    assert len(lines) == 2
    assert lines[0].startswith("Steering of 3, 5, 6 (deg, + at level 1) every 0.2 s from t = 0 s:")
    turned, still, path = feedback.data["series"]
    assert turned["values"][-1] == pytest.approx([np.degrees(0.75)], abs=1.5)
    assert still["values"] == pytest.approx(np.zeros((len(still["times"]), 1)), abs=1.0)
    assert turned["times"] == still["times"] == path["times"]


def test_at_most_four_ways_of_steering_are_told_up_to_where_a_block_breaks_off() -> None:
    tree = machine((0, -1, -1), *((28, 0, face) for face in range(6)))
    turned = np.array([block.quaternion for block in placement.place(tree).blocks])
    trace = make_trace(7, rotation=np.tile(turned, (26, 1, 1)))
    up = np.array([about_axis((0.0, 1.0, 0.0), np.radians(10.0 * block)) for block in range(7)])
    trace.rotation[5:] = compose(up, turned)
    trace.alive[20:, 3] = False
    found = steering_angles(tree, trace)
    assert [line.label for line in found] == [
        "Steering of 1 (deg, + at level 1)",
        "Steering of 2 (deg, + at level 1)",
        "Steering of 3 (deg, + at level 1)",
        "Steering of 4 (deg, + at level 1), 2 more not shown,",
    ]
    assert [len(line.times) for line in found] == [9, 9, 7, 9]
    assert found[1].text.endswith(": 0 0 -20 -20 -20 -20 -20 -20 -20")


@pytest.mark.slow
@pytest.mark.parametrize("spec", installed_engines(), ids=lambda spec: spec.name)
@pytest.mark.parametrize(
    ("level", "name"),
    [
        ("transport/3", "carrier_there_and_back"),
        ("transport/4", "carrier_round_a_wall"),
        ("transport/5", "large_wheeled_carrier"),
    ],
)
def test_a_carrier_is_back_on_both_engines(level: str, name: str, spec: EngineSpec) -> None:
    rollout = simulate(load(f"transport/{name}.json"), replace(get_task(level), engine=spec.name))
    assert rollout.score is not None
    assert rollout.score >= get_level(level).file.good, rollout.feedback.text
