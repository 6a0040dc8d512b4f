"""The procedural model on real physics keeps what the README promises."""

from __future__ import annotations

from pathlib import Path

import pytest

from agentflow.app.design.run import design
from agentflow.app.tasks import find_task
from agentflow.config.run import build_config
from agentflow.env.simulation.simulate import simulate
from agentflow.machine import read_machine

SMALL = {"trajectories": 2, "search": {"strategy": "mcts", "rounds": 1, "width": 2}}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed", "least"), [("throwing", 0, 5.0), ("movement", 1, 30.0)])
def test_search_improves_on_the_first_designs(
    name: str, seed: int, least: float, tmp_path: Path
) -> None:
    """`benchmarks/baseline.py` does so in whole runs, for every family."""
    task = find_task(name)
    result = design(build_config({"task": name, "seed": seed, "settings": SMALL}), tmp_path)
    initial = next(stage for stage in result.stages if stage.name == "initial")
    assert result.score > max(initial.max or 0.0, least)
    machine = read_machine(result.machine, task.brief.blocks).machine
    assert machine is not None
    assert simulate(machine, task, power=False).score == pytest.approx(0.0, abs=0.01)
