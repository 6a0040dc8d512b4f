"""Jumping: who is over, who touched what, and how far it missed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.feedback.clearance import flight_of_root, least_height_over
from agentflow.env.rollout import Verdict
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.jumping import Jumping, JumpReferee
from agentflow.env.tasks.features.barriers import WIDTH
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.prompts.text import token_estimate

from ..fakes import LONE_ROOT, FakeWorld, make_trace

PAIR = Machine((ROOT, Step(1, 35, 0, 0)))
"""The root (0.25) and a ballast (3.0)."""


def level(name: str, **knobs: object) -> Jumping:
    task = get_task(name, knobs)
    assert isinstance(task, Jumping)
    return task


def judge(referee: JumpReferee, world: FakeWorld, *ends: tuple[float, float]) -> Verdict:
    """The verdict after blocks have gone from (0, 0.5, 0) to these (y, z)."""
    referee.start(world)
    for block, (y, z) in enumerate(ends):
        world.centres[block] = (0.0, y, z)
    world.time = 2.0
    referee.watch(world)
    return referee.verdict(make_trace(len(ends)))


def test_the_root_and_half_of_the_mass_have_to_get_over() -> None:
    task = level("jumping")
    over = judge(task.referee(PAIR), FakeWorld(), (0.5, 13.0), (0.5, 14.0))
    assert (over.score, over.terms["success"], over.terms["miss"]) == (1.0, True, None)
    assert over.terms["outcome"] == "success, root ends 0.75 m beyond, 100% of the mass across"
    assert over.terms["mass_beyond"] == 1.0
    light = judge(task.referee(PAIR), FakeWorld(), (0.5, 13.0), (0.5, 12.0))
    assert (light.score, light.terms["outcome"]) == (
        0.0,
        "failed, 8% of the mass across; but root ends 0.75 m beyond",
    )
    short = judge(task.referee(PAIR), FakeWorld(), (0.5, 11.0), (0.5, 13.0))
    assert short.terms["outcome"] == ("failed, root ends 1.25 m short; but 92% of the mass across")
    assert short.terms["miss"] == 1.25


@pytest.mark.parametrize(("more", "share", "success"), [(15, 0.52, True), (41, 0.48, False)])
def test_half_of_the_mass_is_enough(more: int, share: float, success: bool) -> None:
    """The root (0.25) and a block get over, a block of 0.5 does not, nor one of 0.3."""
    machine = Machine((ROOT, Step(1, more, 0, 0), Step(2, 1, 0, 1), Step(3, 15, 0, 2)))
    machine = machine if more == 41 else Machine(machine.steps[:3])
    ends = ((0.5, 13.0), (0.5, 13.0), (0.5, 3.0), (0.5, 3.0))[: len(machine)]
    verdict = judge(level("jumping").referee(machine), FakeWorld(), *ends)
    assert verdict.terms["mass_beyond"] == pytest.approx(share, abs=0.005)
    assert verdict.terms["success"] is success


def test_a_touch_fails_the_trial_whatever_comes_after() -> None:
    referee, world = level("jumping").referee(PAIR), FakeWorld()
    referee.start(world)
    world.time, world.contacts = 1.5, {"wall 1": frozenset({1, "ground"})}
    world.centres = {0: (0.0, 3.0, 11.0), 1: (0.0, 0.75, 12.0)}
    referee.watch(world)
    world.contacts = {}
    verdict = judge_on(referee, world)
    assert verdict.score == 0.0
    assert verdict.terms["outcome"] == (
        "failed, block 1 (Ballast) touched wall 1 at 1.50 s, 0.25 m too low; but root ends "
        "17.75 m beyond, 100% of the mass across"
    )
    assert (verdict.terms["touched"], verdict.terms["touch_time"]) == ("wall 1", 1.5)
    assert verdict.terms["miss"] == pytest.approx(0.25)
    assert [event.kind for event in verdict.events] == ["obstacle_touched"]


def judge_on(referee: JumpReferee, world: FakeWorld) -> Verdict:
    """The verdict of a machine that ends far beyond."""
    world.centres = {0: (0.0, 0.5, 30.0), 1: (0.0, 0.5, 31.0)}
    referee.watch(world)
    return referee.verdict(make_trace(2))


def test_scene_objects_among_themselves_are_no_touch() -> None:
    world = FakeWorld(contacts={"wall 1": frozenset({"ground"})})
    referee = level("jumping").referee(PAIR)
    referee.start(world)
    assert judge_on(referee, world).score == 1.0


def test_what_is_across_before_the_start_fails() -> None:
    world = FakeWorld(centres={1: (0.0, 0.5, 12.0)})
    referee = level("jumping").referee(PAIR)
    referee.start(world)
    verdict = judge_on(referee, world)
    told = str(verdict.terms["outcome"])
    assert told.startswith("failed, block 1 (Ballast) was across before t = 0; but root ends ")
    assert (verdict.score, verdict.terms["miss"]) == (0.0, None)


@pytest.mark.parametrize(("turn", "reach"), [(0.0, 0.5), (45.0, 0.5 * 2**0.5)])
def test_clearance_is_exact_between_samples_of_a_flight(turn: float, reach: float) -> None:
    """A cube falls along a parabola; a wall is passed between samples, where a chord is too low."""
    gravity, speed = -32.0, 10.0
    times = np.arange(6) * 0.2
    heights = 3.0 + 16.0 * times + gravity / 2 * times**2
    path = [(0.0, float(y), float(speed * t)) for t, y in zip(times, heights, strict=True)]
    cube = Machine((ROOT,))
    velocity = np.zeros((6, 1, 3))
    velocity[:, 0, 1], velocity[:, 0, 2] = 16.0 + gravity * times, speed
    trace = make_trace(1, 6, paths={0: path}, velocity=velocity)
    tilt = np.radians(turn) / 2
    trace = replace(trace, rotation=np.tile((np.sin(tilt), 0, 0, np.cos(tilt)), (6, 1, 1)))
    lowest = least_height_over(cube, trace, 5.0)
    assert lowest == pytest.approx(3.0 + 16.0 * 0.5 - 4.0 - reach, abs=0.002)
    assert least_height_over(cube, trace, 11.0) is None


def test_the_flight_of_what_holds_on_to_the_root_is_told() -> None:
    """The ballast stays behind once its connection is lost; a block of which a corner is low is on
    the ground."""
    path = {0: [(0.0, 0.5 + y, 0.0) for y in (0, 0, 1, 2, 1, 0)], 1: [(0.0, 0.5, 1.0)] * 6}
    lost = np.full((6, 1), np.nan)
    lost[0] = 0.5
    trace = make_trace(2, 6, paths=path, utilisation=lost, connections=((1, 0),))
    assert flight_of_root(PAIR, trace, 0.0) == (pytest.approx(0.4), pytest.approx(0.8))
    assert flight_of_root(PAIR, trace, 1.2) is None
    held = replace(trace, utilisation=np.full((6, 1), 0.5))
    assert flight_of_root(PAIR, held, 0.0) is None
    referee = level("jumping").referee(PAIR)
    referee.start(FakeWorld())
    told = level("jumping").feedback(PAIR, trace, (), referee.verdict(trace)).text
    assert ", off the ground from 0.40 to 0.80 s\n" in told


def test_walls_that_were_cleared_are_told_with_the_least_height() -> None:
    task = level("jumping/4")
    paths = {block: [(0.0, 2.0 + block, z) for z in (0.0, 11.0, 14.0, 20.0)] for block in (0, 1)}
    referee = task.referee(PAIR)
    referee.start(FakeWorld())
    verdict = referee.verdict(make_trace(2, 4, paths=paths))
    assert verdict.terms["clearance, wall 1"] == pytest.approx(2.0 - 0.5 - 0.8)
    assert "clearance, wall 2" not in verdict.terms
    assert "; but cleared wall 1 by 0.70 m" in str(verdict.terms["outcome"])


def test_the_conditions_of_a_trial_are_told() -> None:
    trial = level("jumping/4").trials(0)[6]
    assert isinstance(trial, Jumping)
    trace = make_trace(2)
    referee = trial.referee(PAIR)
    referee.start(FakeWorld())
    text = trial.feedback(PAIR, trace, (), referee.verdict(trace)).text
    walls = trial.parameters.walls
    assert f"Conditions: walls {walls.height:.2f} m high at z = {walls.first:.2f} and " in text


def test_the_last_of_two_walls_counts_and_both_are_watched() -> None:
    task = level("jumping/4")
    short = judge(task.referee(PAIR), FakeWorld(), (0.5, 24.0), (0.5, 24.0))
    assert short.terms["far_side"] == 24.25
    assert short.score == 0.0
    for name in ("wall 1", "wall 2"):
        referee, world = task.referee(PAIR), FakeWorld(contacts={name: frozenset({0})})
        referee.start(world)
        assert judge_on(referee, world).terms["touched"] == name


def test_a_trench_forbids_its_floor_and_its_far_wall_only() -> None:
    task = level("jumping/3")
    for name, success in (("ground", False), ("far wall", False), ("far bank", True)):
        referee, world = task.referee(PAIR), FakeWorld(contacts={name: frozenset({0})})
        referee.start(world)
        assert judge_on(referee, world).terms["success"] is success
    referee, world = task.referee(PAIR), FakeWorld(contacts={"far wall": frozenset({0})})
    world.centres[0] = (0.0, 2.0, 17.5)
    referee.start(FakeWorld())
    referee.watch(world)
    assert "at 0.00 s, 0.50 m short, root" in str(judge_on(referee, world).terms["outcome"])


def test_the_trench_lies_between_banks_and_the_slope_before_it() -> None:
    scene = level("jumping/3").scene()
    objects = {item.name: item for item in scene.objects}
    assert set(objects) == {"near bank", "far bank", "far wall", "slope"}
    near, far = objects["near bank"], objects["far bank"]
    assert near.position[2] + near.size[2] / 2 == pytest.approx(12.0)
    assert far.position[2] - far.size[2] / 2 == pytest.approx(18.0)
    assert near.size[1] == far.size[1] == scene.start.height == 3.0
    wall = objects["far wall"]
    assert wall.position[2] - wall.size[2] / 2 < 18.0
    assert wall.size[1] < 3.0


def test_walls_reach_far_to_both_sides() -> None:
    for name, tops in (("jumping", [0.5]), ("jumping/4", [0.8, 0.8]), ("jumping/5", [1.5])):
        scene = level(name).scene()
        assert [item.size[1] for item in scene.objects] == tops
        assert {item.size[0] for item in scene.objects} == {WIDTH}
        assert scene.start.height == 0.0


def test_springs_and_steering_hinges_wait_for_the_jump() -> None:
    task = level("jumping", **{"jump_at": 1.5, "schedule.springs": 0.25})
    schedule = task.schedule
    assert (schedule.motors, schedule.springs, schedule.steering_hinges) == (0.0, 1.75, 1.5)
    told = " ".join(task.brief.schedule)
    assert "At t = 1.75 s springs start to contract." in told
    assert "At t = 1.5 s steering hinges swing once, to their Left." in told


def test_designers_are_told_to_which_side_the_machine_is_turned() -> None:
    for yaw, side in ((3, "right"), (-2.5, "left")):
        task = level("jumping", yaw=yaw)
        assert f"Before that it is turned by {abs(yaw)} degrees to the {side}." in task.brief.scene
        assert task.scene().start.yaw == yaw
    assert not any("Before that" in line for line in level("jumping").brief.scene)


def test_trials_vary_the_trench() -> None:
    trenches = [trial.parameters.trench for trial in level("jumping/3").trials(0)]  # type: ignore[attr-defined]
    assert all(14 <= trench.at <= 16 and 2.7 <= trench.depth <= 3.3 for trench in trenches)
    assert len({trench.at for trench in trenches}) == len({t.depth for t in trenches}) == 10


def test_a_lone_root_stays_where_it_is_in_every_trial() -> None:
    for name in ("jumping", "jumping/3"):
        rollout = simulate(LONE_ROOT, get_task(name))
        assert (rollout.status, rollout.score) == ("ok", 0.0)
        assert rollout.terms["trials"] == 10
        assert str(rollout.terms["outcome_1"]).startswith("failed, root ends ")
        assert token_estimate(rollout.feedback.text) < 1200


def test_the_trench_is_really_there() -> None:
    """A root that is put down over the trench's middle falls to its floor."""
    task = level("jumping/3")
    trench = task.parameters.trench.model_copy(update={"at": 0.0})
    knobs = task.parameters.model_copy(
        update={"trench": trench, "slope": task.parameters.slope.model_copy(update={"angle": 0})}
    )
    fallen = Jumping(task.name, 3, knobs, task.window, task.schedule, trial=1)
    rollout = simulate(LONE_ROOT, fallen)
    assert rollout.trace is not None
    assert rollout.trace.centre[0, 0, 1] == pytest.approx(0.48, abs=0.02)
    assert rollout.terms["touched"] == "ground"
