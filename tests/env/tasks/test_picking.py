"""Picking: the pit, the schedule, and what a crane gets for lifting the ball."""

from __future__ import annotations

import pytest

from agentflow.env.rollout import simulate
from agentflow.env.tasks.registry import get_task
from benchmarks.shelf import load


def test_the_ground_is_as_high_as_the_pit_is_deep() -> None:
    scene = get_task("picking/2").scene()
    assert scene.start.height == 5.0
    grounds = [thing for thing in scene.things if thing.name.endswith("ground")]
    assert [thing.position[1] + thing.size[1] / 2 for thing in grounds] == [5.0] * 4
    near, far, left, right = grounds
    assert near.position[2] + near.size[2] / 2 == 8.0
    assert far.position[2] - far.size[2] / 2 == 15.0
    assert left.position[0] + left.size[0] / 2 == -3.5
    assert right.position[0] - right.size[0] / 2 == 3.5


def test_the_ball_lies_in_the_middle_of_what_a_bar_leaves_free() -> None:
    things = {thing.name: thing for thing in get_task("picking/4").scene().things}
    assert things["ball"].position == (1.75, 1.0, 11.5)
    bar = things["bar"]
    assert (bar.position[0] - bar.size[0] / 2, bar.position[0] + bar.size[0] / 2) == (-3.5, 0.0)
    assert bar.position[1] + bar.size[1] / 2 == 2.0
    assert "bar" not in {thing.name for thing in get_task("picking").scene().things}


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


def test_springs_may_begin_while_winches_are_at_work() -> None:
    switches = get_task("picking", {"schedule.springs": 10}).schedule.switches()
    assert [(entry, level) for time, entry, level in switches if time == 10.0] == [
        ("springs", 1.0),
        ("winches", 1.0),
        ("winches", -1.0),
    ]


@pytest.mark.slow
def test_a_crane_lifts_the_ball_and_carries_it_away() -> None:
    rollout = simulate(load("picking/short_crane.json"), get_task("picking"))
    assert rollout.terms["success"] is True
    assert rollout.score is not None
    assert rollout.score > 4.0
    gained = rollout.feedback.data["gained_per_second"]
    assert len(gained) == 26
    assert max(gained[:14]) < 0.1
    assert "ended outside the pit" in rollout.feedback.text
