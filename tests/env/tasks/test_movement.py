"""The movement referee and its feedback on hand-made drives."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.rollout import Broken
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import ROOT, Machine, Step
from tests.env.fakes import LONE_ROOT, FakeWorld, make_trace

CAR = Machine((ROOT, Step(1, 2, 0, 2)))


def drive(*places: float) -> tuple[float, dict[str, object]]:
    """Score and terms of a root that is at these z, one per second."""
    referee = get_task("movement").referee(LONE_ROOT)
    world = FakeWorld(centres={0: (0.0, 0.5, places[0])})
    referee.start(world)
    for time, z in enumerate(places):
        world.time = float(time)
        world.centres[0] = (0.0, 0.5, z)
        referee.watch(world)
    path = [(0.5 * i, 0.5, z) for i, z in enumerate(places)]
    verdict = referee.verdict(make_trace(1, len(places), 1.0, paths={0: path}))
    return verdict.score, dict(verdict.terms)


def test_the_greatest_distance_counts_not_the_last() -> None:
    score, terms = drive(1.0, 4.0, 11.0, 6.0)
    assert score == 10.0
    assert terms == {"distance": 10.0, "time": 2.0, "final_distance": 5.0, "drift": 1.5}


def test_driving_backwards_scores_nothing() -> None:
    assert drive(0.0, -4.0, -2.0)[0] == 0.0


def test_the_greatest_distance_is_told_with_the_time_at_which_it_was_reached_first() -> None:
    assert drive(0.0, 0.0, 0.0)[1]["time"] == 0.0
    assert drive(0.0, 3.0, 3.0)[1]["time"] == 1.0


def test_the_road_has_walls_on_three_sides() -> None:
    objects = {item.name: item for item in get_task("movement").scene().objects}
    assert set(objects) == {"wall left", "wall right", "wall back"}
    assert objects["wall left"].position == (-12, 2.5, 117)
    assert objects["wall right"].size == (1, 5, 266)
    assert objects["wall back"].position == (0.0, 2.5, -16)
    assert {item.friction for item in objects.values()} == {0}


def test_the_feedback_tells_distance_speeds_and_path() -> None:
    task = get_task("movement")
    referee = task.referee(CAR)
    world = FakeWorld(centres={0: (0.0, 0.5, 0.0)})
    referee.start(world)
    world.time, world.centres[0] = 5.0, (0.0, 0.5, 25.0)
    referee.watch(world)
    velocity = np.zeros((26, 2, 3))
    velocity[:, :, 2] = 5.0
    velocity[5, :, 2] = 11.0  # at 1 s, which ends one second and begins the next
    spin = np.zeros((26, 2, 3))
    spin[6:, 1, 0] = 10.0
    trace = make_trace(
        2,
        paths={0: [(0.0, 0.5, float(i)) for i in range(26)]},
        velocity=velocity,
        angular_velocity=spin,
    )
    broken = (Broken(1, 2, 0, 4.321, 1.04, (0.0, -120.0, 0.0), (50.0, 0.0, 0.0)),)
    feedback = task.feedback(CAR, trace, broken, referee.verdict(trace))
    assert feedback.text.splitlines()[:-1] == [
        "Score: 25.00 m",
        "Root: greatest distance 25.00 m along z+ at 5.00 s, greatest speed 11.00 m/s, "
        "ends at x = 0.00 m",
        "Mean speed in each second (m/s): 6.00, 6.00, 5.00, 5.00, 5.00",
        "Broken: block 1 (Powered Wheel) off block 0 at 4.32 s, load 1.04 "
        "(force, moment: 120 y-, 50 x+)",
        "Orientation of block 0: facing z+ all the time",
        "Frames: at t = 0 world = machine frame + (0.00, -0.50, 0.00)",
    ]
    assert feedback.data["mean_speed_per_second"] == pytest.approx([6.0, 6.0, 5.0, 5.0, 5.0])
    assert feedback.data["broken"] == [
        {
            "block": 1,
            "type": 2,
            "partner": 0,
            "time": 4.321,
            "load": 1.04,
            "force": (0.0, -120.0, 0.0),
            "moment": (50.0, 0.0, 0.0),
        }
    ]
