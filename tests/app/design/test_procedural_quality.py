"""The procedural model on real physics keeps what the README promises."""

from __future__ import annotations

from pathlib import Path
from statistics import median

import pytest

from agentflow.app.design.run import design
from agentflow.app.tasks import find_task
from agentflow.config.run import build_config
from agentflow.env.simulation.simulate import simulate
from agentflow.machine import read_machine

SEEDS = range(2)
LEAST_MEDIAN = {"throwing": 5.0, "movement": 30.0}
"""Metres."""


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", sorted(LEAST_MEDIAN))
def test_search_improves_on_the_first_designs(name: str, tmp_path: Path) -> None:
    task = find_task(name)
    scores, improved = [], 0
    for seed in SEEDS:
        result = design(build_config({"task": name, "seed": seed}), tmp_path)
        initial = next(stage for stage in result.stages if stage.name == "initial")
        scores.append(result.score)
        improved += result.score > (initial.max or 0.0)
        machine = read_machine(result.machine, task.brief.blocks).machine
        assert machine is not None
        assert simulate(machine, task, power=False).score == pytest.approx(0.0, abs=0.01)
    assert median(scores) >= LEAST_MEDIAN[name], scores
    assert improved >= 2, scores
