"""Lifting: where the object is put, and when it counts as lifted."""

from __future__ import annotations

import pytest

from agentflow.env.rollout import Verdict
from agentflow.env.scene import Body
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.lifting import OBJECT, Lifting, LiftingKnobs
from agentflow.env.tasks.features.resting import highest_point_under
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.prompts.text import token_estimate
from benchmarks.shelf import load

from ..fakes import LONE_ROOT, FakeWorld, make_trace

TOWER = Machine((ROOT, Step(1, 63, 0, 4)))
"""The root with a log upright on it: 4 m high."""
LONG = Machine((ROOT, Step(1, 63, 0, 0), Step(2, 15, 1, 9)))
"""The root, a log along z+, a small block on top of its end."""


def level(name: str, **knobs: object) -> Lifting:
    task = get_task(name, knobs)
    assert isinstance(task, Lifting)
    return task


def judge(
    *heights: tuple[float, float], window: float = 5.0, left: float = 9.0, on: Body = 1
) -> Verdict:
    """The verdict over an object that is so high at these times; it starts at 2 m.

    Until `left` (s) it touches block 0, from then on `on`.
    """
    referee = level("lifting", window=window).referee(LONE_ROOT)
    world = FakeWorld(centres={OBJECT: (0.0, 2.0, 0.0)})
    referee.start(world)
    for time, height in heights:
        world.time, world.centres[OBJECT] = time, (0.0, height, 0.0)
        world.contacts[OBJECT] = frozenset({0 if time < left else on})
        referee.watch(world)
    return referee.verdict(make_trace(1))


def test_up_for_a_second_and_at_the_end_is_a_success() -> None:
    verdict = judge((3.9, 3.0), (4.5, 3.5), (5.0, 3.0))
    assert (verdict.score, verdict.terms["success"], verdict.terms["miss"]) == (1.0, True, None)
    assert verdict.terms["held"] == pytest.approx(1.1)
    assert (
        verdict.terms["outcome"]
        == "success, up for 1.10 s, highest 1.50 m at 4.50 s, ends 1.00 m up"
    )
    assert [(event.time, event.kind) for event in verdict.events] == [(3.9, "lifted")]


def test_exactly_a_second_is_enough_and_sums_of_steps_may_miss_it() -> None:
    assert judge((4.0, 3.0), (5.0, 3.0)).score == 1.0
    assert judge((4.0 + 1e-7, 3.0), (5.0, 3.0)).score == 1.0


def test_less_than_a_second_is_not_enough() -> None:
    verdict = judge((4.1, 3.0), (5.0, 3.2))
    assert (verdict.score, verdict.terms["success"]) == (0.0, False)
    assert verdict.terms["outcome"] == ("failed, up for only 0.90 s, highest 1.20 m at 5.00 s")


def test_a_second_in_two_pieces_is_not_enough() -> None:
    verdict = judge((3.0, 3.1), (3.9, 3.1), (4.0, 2.9), (4.2, 3.1), (5.0, 3.1))
    assert not verdict.terms["success"]
    assert verdict.terms["held"] == pytest.approx(0.9)


def test_what_comes_down_again_has_not_been_lifted() -> None:
    verdict = judge((1.0, 8.0), (3.0, 8.0), (5.0, 2.4))
    assert verdict.score == 0.0
    assert verdict.terms["outcome"] == (
        "failed, up for 2.00 s but ends 0.40 m up, highest 6.00 m at 1.00 s"
    )
    assert verdict.terms["miss"] == pytest.approx(0.6)


def test_what_never_rises_a_metre_is_told_how_far_it_rose() -> None:
    verdict = judge((1.0, 2.75), (5.0, 2.5))
    assert verdict.terms["outcome"] == (
        "failed, never rose 1 m, highest 0.75 m at 1.00 s, ends 0.50 m up"
    )
    assert verdict.events == ()


def test_what_rests_up_when_a_rollout_ends_early_stays_up() -> None:
    assert judge((0.5, 3.5), (1.2, 3.5)).terms["held"] == 4.5


def test_what_is_still_in_the_air_or_lies_on_something_else_is_not_lifted() -> None:
    for on in ("ground", "object of the scene"):
        verdict = judge((3.0, 4.0), (4.5, 5.0), (5.0, 3.2), left=4.6, on=on)
        assert (verdict.score, verdict.terms["carried"]) == (0.0, False)
        assert verdict.terms["miss"] is None
        assert verdict.terms["outcome"] == (
            "failed, up but off the machine for the last 0.50 s, highest 3.00 m at 4.50 s"
        )


def test_a_moment_without_contact_at_the_end_does_not_matter() -> None:
    verdict = judge((3.0, 4.0), (4.8, 4.0), (5.0, 4.0), left=4.9, on="ground")
    assert (verdict.score, verdict.terms["carried"]) == (1.0, True)


@pytest.mark.slow
def test_a_throw_that_is_in_the_air_for_over_a_second_is_no_lift_however_late_it_comes() -> None:
    task = level("lifting", **{"schedule.springs": 3.7}).trials(0)[0]
    rollout = simulate(load("lifting/thrower.json"), task)
    assert rollout.terms["held"] == pytest.approx(1.2, abs=0.05)
    assert (rollout.score, rollout.terms["carried"]) == (0.0, False)


@pytest.mark.parametrize(
    ("machine", "x", "z", "top"),
    [
        (LONE_ROOT, 0.0, 0.0, 1.0),
        (TOWER, 0.0, 0.0, 4.0),
        (LONG, 0.0, -1.0, 1.0),
        (LONG, 0.0, 1.0, 2.0),
        (LONG, 4.0, 0.0, 0.0),
        (LONE_ROOT, 1.0, 0.0, 0.0),
        (LONE_ROOT, -1.0, 0.0, 0.0),
        (LONE_ROOT, 0.0, 1.0, 0.0),
        (LONE_ROOT, 0.0, -1.0, 0.0),
    ],
)
def test_the_highest_point_is_looked_for_under_the_object(
    machine: Machine, x: float, z: float, top: float
) -> None:
    assert highest_point_under(machine, x, z, 0.5) == pytest.approx(top)


def test_the_object_stands_on_the_machine_and_on_the_ground_without_one() -> None:
    task = level("lifting/4", **{"object.offset": 0.5})
    (there,) = task.scene(TOWER).objects
    (alone,) = task.scene().objects
    assert there.position == pytest.approx((0.5, 4.5, 0.0))
    assert alone.position == pytest.approx((0.5, 0.5, 0.0))
    assert (there.mass, there.friction, there.size) == (10.0, 0.2, (2.0, 1.0, 2.0))
    assert there.balance == (0.4, 0.0, 0.0)


def test_designers_are_told_where_the_object_is_heavier() -> None:
    for balance, side in ((0.4, "x+"), (-0.25, "x-")):
        told = level("lifting/4", **{"object.balance": balance}).brief.scene
        assert (
            f"It is heavier on one side: its centre of mass is {abs(balance):g} m from its "
            f"centre, towards {side}."
        ) in told
    assert not any("heavier" in line for line in level("lifting").brief.scene)


def test_no_object_is_heaviest_outside_itself() -> None:
    with pytest.raises(
        ConfigError,
        match=r"object\.balance is 1\.2; for an object 2 m wide it must be from -1 to 1",
    ):
        level("lifting/4", **{"object.balance": 1.2})


def test_a_box_tips_off_the_root_when_its_centre_of_mass_lies_beside_it() -> None:
    """The root is 1 m wide; the box is set down with its middle over it."""
    settled = {}
    for balance in (0.0, 0.9):
        task = level("lifting/4", **{"object.balance": balance, "window": 1}).trials(0)[0]
        settled[balance] = simulate(LONE_ROOT, task).terms["settled_height"]
    assert settled == {0.0: pytest.approx(1.45, abs=0.05), 0.9: pytest.approx(1.0, abs=0.1)}


@pytest.mark.parametrize(
    ("name", "shape", "size"),
    [
        ("lifting", "box", (2.0, 1.0, 2.0)),
        ("lifting/3", "sphere", (2.0, 2.0, 2.0)),
        ("lifting/5", "cone", (2.0, 2.0, 2.0)),
    ],
)
def test_every_shape_has_its_size(name: str, shape: str, size: Vec3) -> None:
    (item,) = level(name).scene().objects
    assert (item.shape, item.size) == (shape, size)


def test_trials_vary_mass_place_and_friction() -> None:
    for trial in level("lifting/2").trials(0):
        knobs = trial.parameters
        assert isinstance(knobs, LiftingKnobs)
        item = knobs.object
        assert 13.5 <= item.mass <= 16.5
        assert abs(item.offset) <= 0.1
        assert abs(item.forward) <= 0.1
        assert 0.72 <= item.friction <= 0.88


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lifting", "lifting/5"])
def test_a_machine_that_only_stands_there_lifts_nothing(name: str) -> None:
    rollout = simulate(LONG, get_task(name))
    assert (rollout.status, rollout.score) == ("ok", 0.0)
    assert token_estimate(rollout.feedback.text) < 1200


def test_the_object_settles_on_a_level_place() -> None:
    table = Machine((ROOT, Step(1, 63, 0, 2), Step(2, 63, 0, 3)))
    rollout = simulate(table, level("lifting").trials(0)[0])
    assert rollout.terms["settled_height"] == pytest.approx(1.46, abs=0.03)
    assert rollout.terms["greatest_rise"] == pytest.approx(0.0, abs=0.01)
