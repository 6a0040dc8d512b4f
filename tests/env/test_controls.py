"""Machines with control programs of their own, in real physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task, make_task, recorded_level
from agentflow.errors import ConfigError
from agentflow.machine.controls import NOT_DESIGNED
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import Control, Machine
from tests.env.levels import designed_level, designed_task
from tests.env.machines import CAR, machine
from tests.env.physics.rig import face_towards
from tests.env.test_schedule import Anything
from tests.installed import engine_params

LEFT, RIGHT = (3, 6), (4, 5)
"""Wheels of the car at x- and at x+."""
TURN = replace(CAR, controls=(Control("motors", 0.0, 1.4, 1.0), Control(LEFT, 0.0, 1.4, 0.2)))


def play(tree: Machine, engine: str = "auto", window: float = 1.4) -> Rollout:
    rollout = simulate(tree, designed_task(engine, window=window, road={"half_width": 30}))
    assert (rollout.status, rollout.problems) == ("ok", ())
    return rollout


@pytest.mark.parametrize("engine", engine_params())
def test_a_car_turns_left_while_the_wheels_on_its_left_are_slower(engine: str) -> None:
    trace = play(TURN, engine).trace
    assert trace is not None
    x, y, z, w = trace.even.rotation[-1, 0]
    sideways, ahead = 2 * (x * z + w * y), 1 - 2 * (x * x + y * y)
    assert np.arctan2(-sideways, ahead) > 0.15  # rad towards x-
    assert trace.even.centre[-1, 0, 0] < -0.5


@pytest.mark.slow
@pytest.mark.parametrize("engine", engine_params())
def test_controls_like_the_schedule_give_its_rollout(engine: str) -> None:
    all_on = replace(CAR, controls=(Control("motors", 0.0, 1.4, 1.0),))
    assert play(all_on, engine).digest == play(CAR, engine).digest


@pytest.mark.slow
@pytest.mark.parametrize("engine", engine_params())
def test_a_motor_turns_one_way_holds_and_turns_the_other_way(engine: str) -> None:
    hub = machine((0, -1, -1), (35, 0, 0), (35, 0, 1), (22, 0, 4), (15, 3, 0))
    spun = replace(hub, controls=(Control((3,), 0.2, 0.5, 1.0), Control((3,), 0.8, 0.4, -1.0)))
    trace = play(spun, engine).trace
    assert trace is not None
    spin = (trace.even.angular_velocity[:, 4] - trace.even.angular_velocity[:, 0])[:, 1]
    at = dict(zip(trace.even.times.round(1).tolist(), spin.tolist(), strict=True))
    assert at[0.6] * at[1.0] < 0.0
    assert [abs(at[time]) < 0.2 for time in (0.0, 0.6, 1.0, 1.4)] == [True, False, False, True]


def test_grabbers_grip_until_a_control_opens_them() -> None:
    rows = [(0, -1, -1), (35, 0, 0), (35, 0, 1), (35, 0, 2), (35, 0, 3), (63, 0, 4), (15, 5, 0)]
    rows.append((63, 6, face_towards(machine(*rows), 6, "z+")))
    faces = place(machine(*rows)).blocks[7].faces
    low = [face.face_id for face in faces if face.facing == "y-"][-1]
    tree = machine(*rows, (27, 7, low), (36, 8, 0))
    task = designed_task(window=1)
    anything = Anything(**vars(task))
    held = simulate(replace(tree, controls=(Control((8,), 0.9, 0.1, 1.0),)), anything).trace
    freed = simulate(replace(tree, controls=(Control((8,), 0.4, 0.6, 0.0),)), anything).trace
    assert held is not None
    assert freed is not None
    assert held.even.centre[-1, 9, 1] == pytest.approx(held.even.centre[0, 9, 1], abs=0.02)
    assert freed.even.centre[-1, 9, 1] < freed.even.centre[0, 9, 1] - 0.3


def test_power_off_switches_no_control() -> None:
    rollout = simulate(TURN, designed_task(window=1.4), power=False)
    assert rollout.trace is not None
    assert rollout.trace.even.centre[-1, 0] == pytest.approx(
        rollout.trace.even.centre[0, 0], abs=0.01
    )


def test_a_task_with_a_schedule_does_not_simulate_controls() -> None:
    rollout = simulate(TURN, get_task("movement"))
    assert (rollout.status, [problem["message"] for problem in rollout.problems]) == (
        "invalid",
        [NOT_DESIGNED],
    )


def test_the_brief_says_who_switches() -> None:
    told = designed_task().brief.schedule
    assert "The machine brings its own controls" in told[1]
    assert not any("nothing can be switched" in sentence for sentence in told)
    assert "controls" not in " ".join(get_task("movement").brief.schedule)


def test_only_levels_with_designed_controls_have_trials() -> None:
    with pytest.raises(ConfigError, match="add controls: designed, or remove trials"):
        recorded_level({**designed_level().record, "controls": "schedule", "trials": 3}, "a level")
    level = recorded_level({**designed_level().record, "trials": 3}, "a level")
    brief = make_task(level).brief
    assert (brief.limits.trials, designed_task().brief.limits.trials) == (3, 1)
    assert "A machine has 3 trials. " in brief.schedule[-1]
