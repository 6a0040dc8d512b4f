"""Rockets: how thrust is measured, what height counts, and what a soft landing is."""

from __future__ import annotations

import pytest

from agentflow.env.constants import constants
from agentflow.env.rollout import Verdict
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.geometry.vectors import Vec3
from benchmarks.shelf import load
from tests.env.fakes import LONE_ROOT, FakeWorld, make_trace

GRAVITY = constants()["gravity"]


def judge(level: str, *steps: tuple[float, Vec3, bool], **knobs: object) -> Verdict:
    """The verdict over these times, places of the root and whether it touches the ground."""
    referee = get_task(level, knobs).referee(LONE_ROOT)
    world = FakeWorld(centres={0: (0.0, 0.5, 0.0)}, contacts={"ground": frozenset({0})})
    referee.start(world)
    for time, place, touching in steps:
        world.time, world.centres[0] = time, place
        world.contacts["ground"] = frozenset({0} if touching else ())
        referee.watch(world)
    return referee.verdict(make_trace(1))


def at(height: float) -> Vec3:
    return (0.0, height, 0.0)


def test_thrust_is_mass_times_what_gravity_does_not_explain() -> None:
    """0.25 kg that gains 10 m/s each second."""
    rising = [(time, at(0.5 + 5 * time * time), False) for time in (0.5, 0.75, 1.0)]
    verdict = judge("rocket", *rising)
    assert verdict.score == pytest.approx(0.25 * (10.0 + GRAVITY))
    assert verdict.terms["success"] is True
    falling = [(time, at(50 - GRAVITY / 2 * time * time), False) for time in (0.5, 0.75, 1.0)]
    assert judge("rocket", *falling).score == pytest.approx(0.0, abs=1e-9)


def test_what_stands_on_the_ground_has_no_thrust() -> None:
    standing = [(time, at(0.5), True) for time in (0.5, 0.75, 1.0)]
    assert judge("rocket", *standing).score == 0.0


def test_height_counts_until_it_leaves_the_corridor() -> None:
    path = ((1.0, (0.0, 50.0, 10.0), False), (2.0, (0.0, 90.0, 25.0), False))
    inside, outside = judge("rocket/2", *path), judge("rocket/3", *path)
    assert (inside.score, outside.score) == (89.5, 49.5)
    assert (outside.terms["deviation"], outside.terms["left_corridor"]) == (10.0, True)
    assert outside.terms["success"] is True
    assert outside.terms["result"] == (
        "greatest height 49.50 m at 1.00 s, 10.00 m from the vertical; then it left the corridor"
    )


@pytest.mark.parametrize(("speed", "score"), [(7.5, 40.0), (8.5, 0.0)])
def test_a_landing_counts_if_it_is_slow(speed: float, score: float) -> None:
    end = 0.6
    verdict = judge(
        "rocket/5",
        (1.0, at(40.5), False),
        (5.0, at(end + speed), False),
        (6.0, at(end), False),
        (6.1, at(0.5), True),
    )
    assert verdict.score == score
    assert verdict.terms["touchdown"] == pytest.approx(speed)
    assert judge("rocket/5", (1.0, at(40.5), False)).terms["touchdown"] is None


def test_two_engines_have_exactly_two_cannons() -> None:
    assert get_task("rocket/3").brief.required == {47: 2, 56: 2}
    rollout = simulate(load("rocket/two_engines.json"), get_task("rocket/3", {"engines": 3}))
    assert rollout.status == "invalid"


@pytest.mark.slow
def test_a_throttled_rocket_lands_softly() -> None:
    rollout = simulate(load("rocket/throttled.json"), get_task("rocket/5"))
    assert rollout.score is not None
    assert rollout.score > 60.0
    assert 0.0 < float(rollout.terms["touchdown"] or 0.0) < 8.0
    assert rollout.broken == ()
