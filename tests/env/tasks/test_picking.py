"""Picking: the pit, the schedule, and what a crane gets for lifting the ball."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.rollout import Verdict
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import GRABBER
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import ROOT, Machine, Step
from benchmarks.shelf import load
from tests.env.fakes import LONE_ROOT, FakeWorld, make_trace


def test_the_ground_is_as_high_as_the_pit_is_deep() -> None:
    scene = get_task("picking/2").scene()
    assert scene.start.height == 5.0
    grounds = [item for item in scene.objects if item.name.endswith("ground")]
    assert [item.position[1] + item.size[1] / 2 for item in grounds] == [5.0] * 4
    near, far, left, right = grounds
    assert near.position[2] + near.size[2] / 2 == 8.0
    assert far.position[2] - far.size[2] / 2 == 15.0
    assert left.position[0] + left.size[0] / 2 == -3.5
    assert right.position[0] - right.size[0] / 2 == 3.5


def test_the_ball_lies_in_the_middle_of_what_a_bar_leaves_free() -> None:
    objects = {item.name: item for item in get_task("picking/4").scene().objects}
    assert objects["ball"].position == (1.75, 1.0, 11.5)
    bar = objects["bar"]
    assert (bar.position[0] - bar.size[0] / 2, bar.position[0] + bar.size[0] / 2) == (-3.5, 0.0)
    assert bar.position[1] + bar.size[1] / 2 == 2.0
    assert "bar" not in {item.name for item in get_task("picking").scene().objects}


def test_the_schedule_drives_lowers_grabs_raises_and_drives_back() -> None:
    assert get_task("picking").schedule.switches() == (
        (0.0, "motors", 1.0),
        (0.0, "springs", 1.0),
        (0.0, "winches", 1.0),
        (0.0, "steering_hinges", 1.0),
        (0.0, "grabbers", 0.0),
        (0.0, "winches", 0.0),
        (8.0, "motors", 0.0),
        (8.0, "decouplers", 1.0),
        (8.0, "winches", -1.0),
        (14.0, "winches", 0.0),
        (14.0, "winches", 1.0),
        (14.0, "grabbers", 1.0),
        (22.0, "winches", 0.0),
        (22.0, "motors", -1.0),
    )


@pytest.mark.parametrize(("start", "level"), [(10, -1.0), (16, 1.0), (23, 0.0)])
def test_springs_may_begin_while_winches_are_at_work(start: int, level: float) -> None:
    switches = get_task("picking", {"schedule.springs": start}).schedule.switches()
    assert [(entry, level) for time, entry, level in switches if time == start] == [
        ("springs", 1.0),
        ("winches", 1.0),
        ("winches", level),
    ]


def judge(*places: Vec3) -> Verdict:
    """The verdict over a ball that starts in the pit, 1 m up, and goes to these, 1 s each."""
    referee = get_task("picking").referee(LONE_ROOT)
    world = FakeWorld(centres={"ball": (0.0, 1.0, 11.5)})
    referee.start(world)
    for place in places:
        world.time += 1.0
        world.centres["ball"] = place
        referee.watch(world)
    return referee.verdict(make_trace(1))


def test_the_greatest_height_counts_with_the_time_at_which_it_was_reached_first() -> None:
    verdict = judge((0.0, 3.0, 11.5), (0.0, 5.5, 11.5), (0.0, 5.5, 11.5), (0.0, 2.5, 11.5))
    assert verdict.score == 4.5
    assert verdict.terms == {
        "height": 4.5,
        "time": 2.0,
        "success": False,
        "final_height": 1.5,
        "result": "the ball gained 4.50 m and ended in the pit",
    }
    assert judge((0.0, 0.5, 11.5)).score == 0.0


@pytest.mark.parametrize(
    ("place", "ends"),
    [
        ((0.0, 4.0, 7.0), "outside the pit"),
        ((0.0, 4.0, 16.0), "outside the pit"),
        ((3.6, 4.0, 11.5), "outside the pit"),
        ((-3.6, 4.0, 11.5), "outside the pit"),
        ((3.4, 4.0, 11.5), "over the pit"),
        ((0.0, 4.0, 8.5), "over the pit"),
        ((0.0, 2.9, 11.5), "in the pit"),
        ((0.0, 2.9, 7.0), "in the pit"),
    ],
)
def test_it_is_a_success_when_the_ball_ends_outside_the_pit(place: Vec3, ends: str) -> None:
    verdict = judge(place)
    assert verdict.terms["success"] is (ends == "outside the pit")
    assert str(verdict.terms["result"]).endswith(f" m and ended {ends}")


def test_the_feedback_tells_the_height_of_every_second_and_where_objects_were() -> None:
    """The window has been cut at 10 s: nothing is told of what would have begun later."""
    task = get_task("picking")
    crane = Machine((ROOT, Step(1, GRABBER, 0, 0)))
    times = np.arange(51) * 0.2
    ball = np.array([[(0.0, 1.0 + time / 5, 11.5)] for time in times])
    trace = make_trace(
        2,
        51,
        paths={
            0: [(0.0, 3.5, time) for time in times],
            1: [(0.0, 3.5, time + 1) for time in times],
        },
        object_position=ball,
        objects=("ball",),
    )
    feedback = task.feedback(crane, trace, (), judge((0.0, 3.0, 11.5)))
    lines = feedback.text.splitlines()
    assert lines.pop(4) == "Grabbers at t = 10 s: block 1 (0.00, 3.50, 11.00)"
    assert lines[:4] == [
        "Score: 2.00 m",
        "Result: the ball gained 2.00 m and ended in the pit",
        "Height gained by the ball after each second (m): 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, "
        "1.8, 2.0",
        "Ball at t = 10 s: (0.00, 3.00, 11.50)",
    ]
    assert lines[4] == "Root: (0.00, 3.50, 8.00) at t = 8 s; (0.00, 3.50, 10.00) at t = 10 s"
    assert feedback.data["gained_per_second"] == pytest.approx([0.2 * i for i in range(1, 11)])


@pytest.mark.slow
def test_a_crane_lifts_the_ball_and_carries_it_away() -> None:
    rollout = simulate(load("picking/crane_with_five_grabbers.json"), get_task("picking"))
    assert rollout.terms["success"] is True
    assert rollout.score is not None
    assert rollout.score > 4.0
    gained = rollout.feedback.data["gained_per_second"]
    assert len(gained) == 26
    assert max(gained[:14]) < 0.1
    assert "ended outside the pit" in rollout.feedback.text
