"""Every shipped sweep, small, with the procedural model: it runs, and its table has its rows."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from agentflow.app.sweeps.plan import plan_sweep, sweep_folder
from agentflow.app.sweeps.registry import VIEWS
from agentflow.app.sweeps.run import run_sweep_async
from agentflow.app.sweeps.tables import layout_table, read_sweep_result
from agentflow.app.sweeps.views import view
from agentflow.config.run import load_document
from agentflow.config.sweep import SweepConfig
from agentflow.env.tasks.registry import get_task
from agentflow.metrics.published import published
from tests.app.sweeps.test_run import Notes

CONFIGS = Path(__file__).parents[3] / "configs"
SWEEPS = [
    path
    for path in sorted(CONFIGS.glob("*.yaml"))
    if path.stem != "objectives"  # a list, not a configuration
    and "table" in load_document(path)
    and "benchmark" not in load_document(path)
]


def reduced(path: Path) -> list[str]:
    """Settings that make a sweep small; sweeps without search stay without.

    docs/how-to/sweeps.md runs one with verification.
    """
    settings = ["trajectories=2", "placements=4", "verify=false"]
    if load_document(path)["base"].get("settings", {}).get("search", {}).get("rounds") != 0:
        rounds = 2 if path.stem == "search_depth" else 1
        settings += [f"search.rounds={rounds}", "search.width=2"]
    if path.stem == "coding_agent":
        settings += ["max_simulations=6", "candidates_per_stage=2"]
    if path.stem in ("search_budget", "search_ablations"):
        settings += ["max_simulations=4"]
    return settings


def shortened(sweep: SweepConfig) -> SweepConfig:
    """Of a sweep over many levels, the first of two families whose rollouts are single trials."""
    names = {name: value["task"] for name, value in sweep.axes.get("task", {}).items()}
    single = [name for name in names if len(get_task(names[name]).trials(0)) == 1]
    first = {get_task(names[name]).family: name for name in reversed(single)}
    few = sorted(first.values(), key=single.index)[:2]
    kept = {"task": {name: sweep.axes["task"][name] for name in few}} if names else {}
    return sweep.model_copy(update={"axes": {**sweep.axes, **kept}})


class Quiet(Notes):
    """Accepts results of any size."""

    def run_finished(self, run: str, result: object) -> None:  # noqa: ARG002
        self.said.append(("ended", run))


@pytest.mark.slow
@pytest.mark.parametrize("path", SWEEPS, ids=lambda path: path.stem)
def test_a_sweep_runs_and_has_the_published_table(path: Path, tmp_path: Path) -> None:
    plan = plan_sweep(path, reduced(path), {}, seeds=1, adapt=shortened)
    notes, folder = Quiet(), sweep_folder(plan, path, tmp_path)
    outcome = asyncio.run(run_sweep_async(plan, folder, notes, jobs=2, resume=False))
    assert outcome.failed == {}
    assert len(outcome.done) == len(plan.runs)
    swept = read_sweep_result(outcome.path)
    table = layout_table(swept, published=True)
    models = {run.result.model for run in swept.finished}
    assert models <= {"procedural (no language model)", "none (random edits)"}
    assert all(any(value is not None for value in row.values) for row in table.rows)
    sources = {source.table for source in plan.sweep.table.published}
    known = {item.model for item in published() if item.table in sources}
    assert {row.labels[-1] for row in table.published} <= known
    assert bool(table.published) == bool(sources)
    for name in VIEWS:
        assert view(outcome.path, name).title.startswith(plan.sweep.title)
