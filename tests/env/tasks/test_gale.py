"""Rockets in winds that are not told: ten trials, and what sensing earns there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.rocket import Rocket
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from benchmarks.controllers import LANDING, STOPPING
from tests.machine.controllers import with_change

BLOCKS = json.loads(Path("tests/machines/rocket/throttled.json").read_text())["blocks"]


def flown(controllers: Any, trial: int = 0) -> dict[str, Any]:
    """Terms of one trial."""
    machine = Machine.from_json({"blocks": BLOCKS, "controllers": controllers})
    task = get_task("rocket/6").trials(0)[trial]
    return dict(simulate(machine, task).terms)


def test_winds_are_drawn_by_the_seed_and_not_told() -> None:
    task = get_task("rocket/6")
    assert isinstance(task, Rocket)
    trials = task.trials(0)
    assert len(trials) == 10
    assert trials == task.trials(0)
    winds = [trial.scene().wind for trial in trials]
    assert len(set(winds)) == 10
    assert all(abs(speed) <= 2 for wind in winds for speed in wind)
    told = " ".join((*task.brief.scene, *task.brief.score))
    assert "up to 2 m/s up or down" in told
    assert not any(f"{abs(wind[0]):g} m/s" in told for wind in winds)
    assert trials[0].trials(0) == (trials[0],)
    plain = get_task("rocket/5")
    assert plain.trials(0) == (plain,)
    assert get_task("rocket/2", {"gale.wind": 2}).trials(0)[0].name == "rocket/2"


def test_a_trial_ends_as_the_rocket_lands_and_says_how() -> None:
    found = flown(LANDING.controllers)
    assert found["success"]
    assert str(found["outcome"]).startswith("rose 1")
    assert "m/s, " in str(found["outcome"])
    low = flown(with_change("laws.fly.states.0.leave.0.above", 5, dict(LANDING.controllers)))
    assert not low["success"]
    never = flown(with_change("laws.fly.states.0.leave.0.above", 900, dict(LANDING.controllers)))
    assert not never["success"]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
@pytest.mark.parametrize("comparison", [LANDING, STOPPING])
def test_the_controllers_of_the_page_succeed_in_every_trial(comparison: Any, engine: str) -> None:
    task = get_task(comparison.task, engine=engine)
    assert simulate(comparison.sensing(), task).score == 10
