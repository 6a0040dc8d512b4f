"""Movement with a wall ahead: ten trials, what sensing earns, and what cheats do not."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine
from tests.machine.controllers import sensing_car, with_change

LOOKING: dict[str, Any] = {
    "sensors": {"ahead": {"kind": "distance", "block": 1, "axis": "z+"}},
    "laws": {"approach": {"kind": "pd", "sensor": "ahead", "target": 2, "p": -0.1}},
    "outputs": [{"group": "motors", "law": "approach"}],
}


def first_trial(machine: Machine, engine: str = "auto", **knobs: object) -> Rollout:
    task = get_task("movement/6", knobs, engine)
    return simulate(machine, task.trials(0)[0])


def test_walls_are_drawn_by_the_seed_and_are_the_target_of_the_trial() -> None:
    task = get_task("movement/6")
    assert isinstance(task, Movement)
    trials = task.trials(0)
    assert len(trials) == 10
    assert trials == task.trials(0)
    assert trials != task.trials(1)
    places = [trial.scene().target[2] for trial in trials]
    assert len(set(places)) == 10
    assert all(20 <= place <= 40 for place in places)
    walls = [trial.scene().objects[-1] for trial in trials]
    assert [wall.position[2] - 0.5 for wall in walls] == pytest.approx(places)
    assert trials[0].trials(0) == (trials[0],)
    assert get_task("movement").trials(0) == (get_task("movement"),)
    assert task.brief.greatest == 10
    assert "from 20 to 40 m" in " ".join(task.brief.scene)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_a_car_that_looks_ahead_stops_in_every_trial(engine: str) -> None:
    found = simulate(sensing_car(LOOKING), get_task("movement/6", engine=engine))
    assert found.score == 10
    assert "All 10 trials: stopped " in found.feedback.text
    target = with_change("sensors.ahead", {"kind": "target", "block": 1, "axis": "z"}, LOOKING)
    assert first_trial(sensing_car(target), engine).score == 1


def test_who_touches_the_wall_or_does_not_stop_fails() -> None:
    blind = with_change("laws.approach", {"kind": "constant", "level": 1}, LOOKING)
    found = first_trial(sensing_car(blind))
    assert found.score == 0
    assert str(found.terms["outcome"]).startswith("touched the wall at 4.")
    late = first_trial(sensing_car(LOOKING), window=3)
    assert "m before the wall, still at 9.8" in str(late.terms["outcome"])


def test_shaking_blocks_gets_no_machine_through_a_wall() -> None:
    shaking = {
        "sensors": {"ahead": {"kind": "distance", "block": 1, "axis": "z+"}},
        "laws": {
            "full": {"kind": "constant", "level": 1},
            "back": {"kind": "constant", "level": -1},
            "shake": {
                "kind": "states",
                "states": [
                    {
                        "name": "a",
                        "law": "full",
                        "leave": [{"sensor": "ahead", "below": 3, "to": "b"}],
                    },
                    {
                        "name": "b",
                        "law": "back",
                        "leave": [{"sensor": "ahead", "above": 2, "to": "a"}],
                    },
                ],
            },
        },
        "outputs": [{"group": "motors", "law": "shake"}],
    }
    for engine in ("pybullet", "mujoco"):
        found = first_trial(sensing_car(shaking), engine)
        assert found.score == 0
        assert float(found.terms["gap"] or 0) > 0, "no block is beyond the face of the wall"


def test_neither_the_future_nor_other_trials_can_be_named() -> None:
    """What a machine holds is data, without any word for either."""
    for cheat in (
        {"kind": "target", "axis": "z", "trial": 2},
        {"kind": "time", "ahead": 1.0},
        {"kind": "wind"},
        {"kind": "seed"},
    ):
        with pytest.raises(AssertionError):
            sensing_car(with_change("sensors.ahead", cheat, LOOKING))
    trial = get_task("movement/6").trials(0)[0]
    assert isinstance(trial, Movement)
    elsewhere = replace(trial, wall=trial.wall - 5)
    reads = [
        simulate(sensing_car(LOOKING), each).feedback.data["controllers"]["sensors"]["ahead"][0]
        for each in (trial, elsewhere)
    ]
    assert reads[0] - reads[1] == pytest.approx(5, abs=0.01)
    assert json.dumps(LOOKING).count("wall") == 0
