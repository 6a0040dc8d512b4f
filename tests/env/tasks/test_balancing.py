"""Machines on two wheels that are pushed: ten trials, and what must be kept in them."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from agentflow.machine import Machine
from benchmarks.shelf import load
from tests.machine.controllers import with_change

UPRIGHT = load("movement/upright.json")


def trial(machine: Machine, engine: str = "auto", **knobs: Any) -> str:
    """Outcome of the first trial."""
    return str(
        simulate(machine, get_task("movement/7", knobs, engine).trials(0)[0]).terms["outcome"]
    )


def controlled(path: str, value: Any) -> Machine:
    """The reference with one change of its controllers."""
    assert UPRIGHT.controllers is not None
    changed = with_change(path, value, UPRIGHT.controllers.to_json())
    blocks = [step.to_json() for step in UPRIGHT.steps]
    return Machine.from_json({"blocks": blocks, "controllers": changed})


def test_gusts_are_drawn_by_the_seed_and_not_told() -> None:
    task = get_task("movement/7")
    assert isinstance(task, Movement)
    trials = task.trials(0)
    assert len(trials) == 10
    assert trials == task.trials(0) != task.trials(1)
    winds = [each.scene().wind[2] for each in trials]
    assert all(1.5 <= abs(wind) <= 3 for wind in winds)
    assert {wind > 0 for wind in winds} == {True, False}
    begins = [each.schedule.more[2][0] for each in trials]
    assert all(1 <= begin <= 6 for begin in begins)
    told = " ".join(task.brief.scene)
    assert "at 1.5 to 3 m/s" in told
    assert not any(f"{abs(wind):g} m/s" in told for wind in winds)
    assert task.brief.required == {2: 2}
    assert trials[0].trials(0) == (trials[0],)
    with pytest.raises(ConfigError, match=r"stop\.gap and balance\.height exclude each other"):
        get_task("movement/7", {"stop.gap": 1})
    with pytest.raises(
        ConfigError, match=r"until 10\.2 s, .* 10 s has ended: lower balance\.until"
    ):
        get_task("movement/7", {"balance.until": 9.7})


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_trial_ends_as_the_machine_falls(engine: str) -> None:
    assert trial(UPRIGHT, engine) == "upright to the end"
    blind = trial(controlled("outputs.0.scale", 0), engine)
    assert blind.startswith("its centre of mass was 1.")
    assert trial(UPRIGHT, engine, **{"balance.height": 4}).endswith(" m above the ground at 0.00 s")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_every_block_is_held_until_the_start(engine: str) -> None:
    """With a weight in front, which would tip it before t = 0."""
    weight = {"type": 35, "id": len(UPRIGHT), "parent": 5, "face_id": 8}
    blocks = [*(step.to_json() for step in UPRIGHT.steps), weight]
    tipping = Machine.from_json({"blocks": blocks})
    heights = []
    for name in ("movement/7", "movement"):
        found = simulate(tipping, get_task(name, {"controls": "sensed"}, engine).trials(0)[0])
        assert found.trace is not None
        heights.append(found.trace.centre[0, 6, 1])
    assert heights[0] == pytest.approx(5, abs=0.03)
    assert heights[1] < 3
