"""The delivery referee and its feedback on hand-made ways of the cargo."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.rollout import Trace, Verdict
from agentflow.env.scene import Body
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import ROOT, Machine, Step
from tests.env.fakes import LONE_ROOT, FakeWorld, make_trace

GROUND: frozenset[Body] = frozenset({"ground"})
PUSHED: frozenset[Body] = frozenset({"ground", 0})
FREE: frozenset[Body] = frozenset()
Moment = tuple[float, Vec3, frozenset[Body]]


def judge(*moments: Moment, task: str = "delivery") -> Verdict:
    """Let the referee watch the cargo be at these places at these times."""
    referee = get_task(task).referee(LONE_ROOT)
    world = FakeWorld(centres={"cargo": (0.0, 1.5, 15.0)}, contacts={"cargo": GROUND})
    referee.start(world)
    for time, place, contacts in moments:
        world.time = time
        world.centres["cargo"], world.contacts["cargo"] = place, contacts
        referee.watch(world)
    return referee.verdict(trace_of(15.0))


def trace_of(*places: float) -> Trace:
    path = np.array([[(0.0, 1.5, z)] for z in places])
    return make_trace(1, len(places), object_position=path, objects=("cargo",))


def test_what_is_pushed_scores_its_greatest_distance() -> None:
    verdict = judge(
        (1.0, (0.0, 1.5, 15.0), PUSHED),
        (2.0, (0.5, 1.5, 35.0), PUSHED),
        (2.5, (0.5, 1.5, 35.0), PUSHED),
        (3.0, (0.5, 1.5, 30.0), GROUND),
    )
    assert verdict.score == 20.0
    assert verdict.terms == {
        "distance": 20.0,
        "time": 2.0,
        "final_distance": 15.0,
        "touched": 1.0,
        "reach": pytest.approx(20.006, abs=1e-3),
        "height": 1.5,
        "landing": None,
    }
    assert [(event.kind, event.time) for event in verdict.events] == [("cargo_touched", 1.0)]


def test_a_cargo_that_is_never_touched_scores_nothing() -> None:
    verdict = judge((1.0, (0.0, 1.5, 16.0), GROUND), (9.0, (0.0, 1.5, 60.0), GROUND))
    assert verdict.score == 0.0
    assert verdict.terms["touched"] is None
    assert verdict.terms["final_distance"] == 0.0


def test_what_rolls_by_itself_before_it_is_touched_earns_nothing() -> None:
    verdict = judge(
        (1.0, (0.0, 1.5, 20.0), GROUND),
        (5.0, (0.0, 1.5, 45.0), PUSHED),
        (6.0, (0.0, 1.5, 50.0), GROUND),
    )
    assert verdict.score == 5.0


def test_pushed_backwards_scores_nothing() -> None:
    assert judge((1.0, (0.0, 1.5, 15.0), PUSHED), (2.0, (0.0, 1.5, 5.0), PUSHED)).score == 0.0


def test_along_a_curve_the_centre_line_counts() -> None:
    """Half of the half circle of radius 19 about x = 19, z = 15."""
    moments = [
        (i / 10, (19 - 19 * np.cos(i / 60 * np.pi), 1.5, 15 + 19 * np.sin(i / 60 * np.pi)), PUSHED)
        for i in range(31)
    ]
    assert judge(*moments, task="delivery/5").score == pytest.approx(19 * np.pi / 2)


def test_coming_down_after_a_flight_is_a_landing() -> None:
    verdict = judge(
        (1.0, (0.0, 1.5, 15.0), PUSHED),
        (1.1, (0.0, 4.0, 17.0), FREE),
        (1.5, (0.0, 1.5, 25.0), GROUND),
        (1.6, (0.0, 2.5, 26.0), FREE),
        (2.6, (0.0, 1.5, 29.0), GROUND),
    )
    assert verdict.terms["landing"] == 1.5
    assert verdict.terms["height"] == 4.0


@pytest.mark.parametrize(("down", "landing"), [(1.4, 1.4), (1.35, None)])
def test_a_flight_of_a_fifth_of_a_second_ends_in_a_landing(
    down: float, landing: float | None
) -> None:
    verdict = judge(
        (1.2, (0.0, 2.0, 15.0), FREE),
        (1.3, (0.0, 2.0, 16.0), FREE),
        (down, (0.0, 1.5, 17.0), GROUND),
    )
    assert verdict.terms["landing"] == landing


def test_the_nearest_block_is_what_the_cargo_is_away_from() -> None:
    pair = Machine((ROOT, Step(1, 15, 0, 0)))
    path = np.array([[(0.0, 0.0, 15.0)]] * 2)
    trace = make_trace(
        2,
        2,
        paths={0: [(0.0, 0.0, 0.0), (0.0, 0.0, 12.0)], 1: [(0.0, 0.0, 1.0), (0.0, 0.0, 10.0)]},
        object_position=path,
        objects=("cargo",),
    )
    feedback = get_task("delivery").feedback(pair, trace, (), judge())
    assert feedback.data["gap"] == [14.0, 3.0]


def test_the_feedback_tells_the_cargo_and_its_distance_to_the_machine() -> None:
    task = get_task("delivery")
    referee = task.referee(LONE_ROOT)
    world = FakeWorld(centres={"cargo": (0.0, 1.5, 15.0)}, contacts={"cargo": PUSHED})
    referee.start(world)
    world.time, world.centres["cargo"] = 5.0, (0.0, 1.5, 40.0)
    referee.watch(world)
    trace = trace_of(*(15.0 + i for i in range(26)))
    feedback = task.feedback(LONE_ROOT, trace, (), referee.verdict(trace))
    lines = feedback.text.splitlines()
    assert lines[:3] == [
        "Score: 25.00 m",
        "Result: the machine first touched the cargo at 0.00 s",
        "Cargo: greatest distance 25.00 m along z+ at 5.00 s, greatest horizontal distance "
        "25.00 m, greatest height 1.50 m, no landing after free flight",
    ]
    assert lines[3].startswith(
        "Distance from the cargo's centre to the nearest block every 0.6 s (m): 15.1 18.1 21.1 "
    )
    assert lines[-1].startswith("Cargo position every 0.6 s from t = 0 s (x, y, z): (0.00, 1.50, ")
    assert len(feedback.data["gap"]) == 9
    nothing = task.referee(LONE_ROOT)
    nothing.start(FakeWorld())
    text = task.feedback(LONE_ROOT, trace, (), nothing.verdict(trace)).text
    assert text.splitlines()[1] == "Result: the machine never touched the cargo"


def test_the_prompt_tells_what_lies_on_the_road() -> None:
    text = " ".join(get_task("delivery/4").brief.scene)
    assert "a ball of diameter 3 m and mass 5 kg" in text
    assert "its centre at x = 0, y = 1.5, z = 15 m" in text
    assert "its middle at z = 8 m and its underside 4 m above the ground" in text
    assert "flat at z = 31.7 m and steepens to its edge at z = 38.3 m, 3.5 m high" in text
    assert (
        "A cone of diameter 12 m and height 1.5 m, tip upward, stands in the middle of the road "
        "at x = 38 m, z = 0 m." in get_task("delivery/5").brief.scene
    )


def test_a_cone_stands_beyond_the_place_of_the_turn_also_where_nothing_turns() -> None:
    task = get_task("delivery", {"cone.height": 1.5, "cone.further": 12, "curve.at": 30})
    (cone,) = (item for item in task.scene().objects if item.name == "cone")
    assert cone.position == (0.0, 0.75, 42.0)
    assert any("at x = 0 m, z = 42 m" in line for line in task.brief.scene)


def test_no_machine_may_begin_within_the_beam() -> None:
    assert get_task("delivery").brief.limits.size == (17.0, 9.5, 17.0)
    assert get_task("delivery/3").brief.limits.size == (17.0, 9.5, 15.0)
    assert get_task("delivery/3", {"beam.at": 20}).brief.limits.size == (17.0, 9.5, 17.0)


def test_only_the_cargo_moves_in_the_scene() -> None:
    for level in ("delivery", "delivery/2", "delivery/3", "delivery/4", "delivery/5"):
        (cargo,) = (item for item in get_task(level).scene().objects if item.mass)
        assert (cargo.name, cargo.shape, cargo.size) == ("cargo", "sphere", (3, 3, 3))


def test_the_cargo_lies_on_the_road_wherever_that_leads() -> None:
    task = get_task("delivery/5", {"cargo.at": 15 + 19 * np.pi / 2})
    (cargo,) = (item for item in task.scene().objects if item.mass)
    assert cargo.position == pytest.approx((19.0, 1.5, 34.0))
    assert "x = 19, y = 1.5, z = 34 m" in " ".join(task.brief.scene)
