"""Cargo that falls at a moment that nobody is told: ten trials of transport."""

from __future__ import annotations

import pytest

from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.transport import Transport
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from benchmarks.shelf import load

WAITING, HASTY = load("transport/waiting_carrier.json"), load("transport/hasty_carrier.json")


def test_moments_are_drawn_by_the_seed_and_not_told() -> None:
    task = get_task("transport/6")
    assert isinstance(task, Transport)
    trials = task.trials(0)
    assert len(trials) == 10
    assert trials == task.trials(0) != task.trials(1)
    moments = [each.schedule.more[0][0] for each in trials]
    assert all(1 <= moment <= 10 for moment in moments)
    assert [each.window for each in trials] == pytest.approx([moment + 5 for moment in moments])
    assert {each.limits.controls for each in trials} == {task.limits.controls} == {15}
    told = " ".join((*task.brief.scene, *task.brief.score))
    assert "from t = 1 to 10 s" in told
    assert not any(f"{moment:g} s" in told for moment in moments)
    assert trials[0].trials(0) == (trials[0],)
    assert get_task("transport/2").trials(0) == (get_task("transport/2"),)
    with pytest.raises(ConfigError, match=r"cargo of transport/6: falls must be 0 or at least 1"):
        get_task("transport/6", {"cargo.falls": 0.5})
    with pytest.raises(ConfigError, match=r"may fall at 9 s, .* 8 s has ended: lower cargo\.falls"):
        get_task("transport/6", {"cargo.falls": 9, "window": 8})


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_the_cargo_hangs_still_and_then_falls_freely(engine: str) -> None:
    trial = get_task("transport/6", engine=engine).trials(0)[9]
    begin = trial.schedule.more[0][0]
    found = simulate(HASTY, trial)
    assert found.trace is not None
    assert found.terms["lost_at"] == pytest.approx(begin + 0.49, abs=0.02)  # 4 m at 32.8 m/s2
    times, places = found.trace.times, found.trace.object_position[:, 0]
    held = places[times <= begin]
    assert abs(held - held[0]).max() < 0.01
    assert found.score == 0


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_carrier_that_waits_for_it_arrives_in_every_trial(engine: str) -> None:
    found = simulate(WAITING, get_task("transport/6", engine=engine))
    assert found.score == 10
    assert "All 10 trials: arrived: " in found.feedback.text
