"""What sensors read and laws gave, under the film of a machine."""

from __future__ import annotations

import pytest

from agentflow.app.pages.films import MOST_SPANS, Shapes, machine_data
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from benchmarks.controllers import STOPPING


def test_sensors_targets_and_outputs_are_curves_in_step_with_the_film() -> None:
    machine = STOPPING.sensing()
    rollout = simulate(machine, get_task(STOPPING.task).trials(0)[0])
    sensor, law = machine_data(machine, rollout, Shapes())["lanes"]
    assert sensor["name"].startswith("sensor ahead, as a share of 3")
    assert law["name"] == "law approach (target 2), as a share of 1"
    for lane in (sensor, law):
        assert 20 < len(lane["spans"]) <= MOST_SPANS
        assert lane["spans"][0] == [0.0, pytest.approx(0.2, abs=0.1), 1.0]
        assert all(begin <= end for begin, end, _ in lane["spans"])
        assert abs(lane["spans"][-1][2]) < 0.2
    assert machine_data(machine, None, Shapes())["lanes"] == []
