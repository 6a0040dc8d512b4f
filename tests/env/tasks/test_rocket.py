"""Rockets: how thrust is measured, what height counts, and what a soft landing is."""

from __future__ import annotations

import pytest

from agentflow.env.constants import constants
from agentflow.env.rollout import Verdict
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.machine.blocks.library import TORCH, WATER_CANNON
from agentflow.machine.geometry.vectors import Vec3
from benchmarks.shelf import load
from tests.env.fakes import LONE_ROOT, FakeWorld, make_trace
from tests.env.machines import machine

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


@pytest.mark.parametrize(("speed", "score"), [(3.5, 40.0), (4.5, 0.0)])
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


@pytest.mark.parametrize(("aside", "score"), [(19.0, 40.0), (21.0, 0.0)])
def test_a_landing_counts_if_it_is_near_the_start(aside: float, score: float) -> None:
    """Height counts in the same corridor; what happens after the landing is no matter."""
    there = (0.0, 0.6, aside)
    verdict = judge(
        "rocket/5",
        (1.0, at(40.5), False),
        (6.0, there, False),
        (6.5, there, False),
        (6.6, there, True),
        (9.0, (0.0, 0.5, 50.0), True),
    )
    assert verdict.score == score
    assert f"at 0.00 m/s, {aside:.2f} m from the start" in str(verdict.terms["result"])
    assert verdict.terms["left_corridor"] is (aside > 20.0)


def test_height_after_the_landing_does_not_count() -> None:
    """Else a hop would land softly, and a flight that never ends would count."""
    hop = ((1.0, at(2.0), False), (1.5, at(0.7), False), (1.6, at(0.5), True))
    verdict = judge("rocket/5", *hop, (20.0, at(5000.0), False))
    assert verdict.score == pytest.approx(1.5)
    assert judge("rocket/2", *hop, (20.0, at(5000.0), False)).score == 4999.5


def test_two_engines_have_exactly_two_cannons() -> None:
    assert get_task("rocket/3").brief.required == {47: 2, 56: 2}
    rollout = simulate(load("rocket/two_engines.json"), get_task("rocket/3", {"engines": 3}))
    assert rollout.status == "invalid"


def test_feedback_tells_for_how_long_each_cannon_fired_as_steam_and_cold() -> None:
    """The torch heats cannon 1, which it loses after 2 s; nothing heats cannon 2."""
    tree = machine((0, -1, -1), (WATER_CANNON, 0, 2), (WATER_CANNON, 0, 3), (TORCH, 0, 4))
    upside_down = (0.0, 0.0, 1.0, 0.0)
    referee, world = get_task("rocket/2").referee(tree), FakeWorld(rotations={3: upside_down})
    world.centres = {1: (0.0, 5.0, 0.2), 2: (0.0, 5.0, 0.4), 3: (0.0, 6.0, 0.0)}
    referee.start(world)
    for step in range(1, 51):
        world.time = step / 10
        world.levels["motors"] = float(step > 10)
        if step == 31:
            world.centres[1] = (0.0, 9.0, 0.0)
        referee.watch(world)
    fired = referee.verdict(make_trace(4)).terms["cannons"]
    assert fired == "1 as steam 2.0 s, cold 2.0 s; 2 cold 4.0 s"


@pytest.mark.parametrize(("power", "fired"), [(True, "cold 0.5 s"), (False, "never fired")])
def test_without_power_no_cannon_fires(power: bool, fired: str) -> None:
    rollout = simulate(load("rocket/cold.json"), get_task("rocket/2"), power=power)
    assert f"\nWater cannons: 2, 4 {fired}\n" in rollout.feedback.text


@pytest.mark.slow
def test_a_throttled_rocket_lands_softly() -> None:
    knobs = {"touchdown": 8, "wind.cross": 0}
    rollout = simulate(load("rocket/throttled.json"), get_task("rocket/5", knobs))
    assert rollout.score is not None
    assert rollout.score > 60.0
    assert rollout.terms["cannons"] == "4, 9 as steam 30.0 s"
    assert 0.0 < float(rollout.terms["touchdown"] or 0.0) < 8.0
    assert rollout.broken == ()
