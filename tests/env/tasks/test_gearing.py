"""Gearing: what is given, told, scored and fed back, on real physics."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.families.gearing import GearingKnobs
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from agentflow.machine.tree import Machine, Step
from tests.env.fakes import make_trace

MEDIUM, LARGE = 38, 51


def placed(level: str, *middles: tuple[float, float], power: bool = True) -> Rollout:
    task = get_task(level)
    assert isinstance(task.parameters, GearingKnobs)
    faces = (task.parameters.base.face(x, z) for x, z in middles)
    given = task.brief.given.steps
    added = (Step(len(given) + i, MEDIUM, 0, face) for i, face in enumerate(faces))
    return simulate(Machine((*given, *added)), task, power=power)


def test_a_row_of_cogs_turns_the_target() -> None:
    rollout = placed("gearing", (0, 0))
    assert (rollout.status, rollout.score) == ("ok", 1.0)
    assert rollout.terms["result"] == "turning as required for 5.0 s"
    assert rollout.terms["speed_1"] == pytest.approx(2.0, abs=0.01)
    text = rollout.feedback.text
    assert "Meshing: 1-3, 2-3\nLocked: none\nCoupled to the source: 2, 3" in text
    speeds = rollout.feedback.data["speeds"]
    assert speeds == {
        cog: pytest.approx(v, abs=0.02) for cog, v in {"1": 2, "2": 2, "3": -2}.items()
    }


def test_power_off_and_a_gap_turn_nothing() -> None:
    assert placed("gearing", (0, 0), power=False).score == 0.0
    assert placed("gearing", (1.5, 0)).score == 0.0


def test_the_wrong_sense_is_worth_nothing() -> None:
    row = ((0, -2), (0, 0), (0, 2))
    assert placed("gearing/2", *row).score == 1.0
    wrong = placed("gearing/3", *row)
    assert wrong.score == 0.0
    assert wrong.terms["held"] == 0.0


def test_the_feedback_tells_what_is_locked_and_speeds_with_the_source() -> None:
    """A small and two large cogs that all mesh; the source turns at -2 rad/s about y."""
    task = get_task("gearing", {"plate.size": 15})
    assert isinstance(task.parameters, GearingKnobs)
    faces = [task.parameters.base.face(x, z) for x, z in ((3.5, -2), (0, 1.5))]
    cogs = (Step(i, LARGE, 0, face) for i, face in enumerate(faces, start=3))
    machine = Machine((*task.brief.given.steps, *cogs))
    spin = np.zeros((26, 5, 3))
    spin[-6:, 1:, 1] = (-2.0, 0.5, 0.0, -1.0)
    still = task.referee(machine).verdict(make_trace(5))
    feedback = task.feedback(machine, make_trace(5, angular_velocity=spin), (), still)
    assert feedback.text.splitlines()[2:6] == [
        "Speeds at the end, by block (rad/s, positive with the source): 1: 2.00, 2: -0.50, "
        "3: 0.00, 4: 1.00",
        "Meshing: 1-3, 1-4, 3-4",
        "Locked: 1-3-4",
        "Coupled to the source: 3, 4",
    ]
    assert feedback.data["locked"] == [[1, 3, 4]]


def test_each_of_two_targets_has_its_own_place_and_sense() -> None:
    for spread, places in ((8, ((-4.0, 2.0), (4.0, 2.0))), (7, ((-3.5, 2.0), (3.5, 2.0)))):
        asked = {"target.count": 2, "target.spread": spread, "target.second": "against"}
        task = get_task("gearing", {"plate.size": 15, **asked})
        assert isinstance(task.parameters, GearingKnobs)
        assert task.parameters.targets == places
        assert task.parameters.senses == ("with", "against")
        told = task.brief.score[0]
        first = "block 2 (target) turns in the same direction as the source and block 3 (target)"
        assert first in told
        assert "turns in the opposite direction to the source, at 0.5 rad/s" in told


def test_two_targets_must_turn_together() -> None:
    told = " ".join(get_task("gearing/5").brief.score)
    assert "block 2 (target) turns" in told
    assert "block 3 (target) turns" in told
    assert "both at the same time, for 1 s without interruption within 5 s" in told


@pytest.mark.parametrize(
    ("knobs", "problem"),
    [
        (
            {"distance": 20},
            "source and targets do not fit on the plate: x = 0, z = -10 m is not on "
            "a plate 9 m wide",
        ),
        ({"plate.holes": 20}, "plate.holes is 20; on a plate "),
        (
            {"target.turn": "sideways"},
            "target.turn of gearing must be with or against, not 'sideways'",
        ),
    ],
)
def test_what_does_not_fit_is_refused(knobs: dict[str, object], problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        get_task("gearing", knobs)
    assert str(caught.value).startswith(problem)
