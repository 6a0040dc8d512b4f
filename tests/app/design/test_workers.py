"""A run whose workflow instance comes from the caller: any worker can design in place of models."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.config.run import build_config
from agentflow.errors import InterruptedRunError
from agentflow.runs import read_document
from agentflow.runs.events import read_typed_events
from agentflow.runs.locations import FEEDBACK, StageName
from agentflow.runs.record import RunRecord
from agentflow.tools.bench import Bench
from agentflow.workflows.tools import TOOLS, work_in_stages, workflow_of

CAR = Path("examples/car.json").read_text(encoding="utf-8")


async def drive(bench: Bench, stage: StageName) -> None:
    """Submit the example car."""
    assert stage == FEEDBACK
    checked = await bench.call("check", {"machine": CAR})
    await bench.call("submit", {"machine": checked.data["machine"]})
    await asyncio.wait_for(bench.wait_ended(), 1)


def by(name: str) -> RunOptions:
    stages = partial(work_in_stages, worker=drive, stages=(FEEDBACK,))
    flow = replace(TOOLS, stages=stages, author=lambda _: name, repeatable=False)
    return RunOptions(workflow=flow)


@pytest.mark.slow
def test_a_worker_designs_in_place_of_models(tmp_path: Path) -> None:
    settings = {"candidates_per_stage": 1, "max_simulations": 2}
    config = build_config(
        {"task": "movement", "workflow": "tools", "settings": settings, "verify": False}
    )
    result = design(config, tmp_path, by("client 1.0"), "run")
    run = tmp_path / "run"
    assert result.model == "client 1.0"
    assert result.score > 40
    assert result.calls == 0
    assert [stage.name for stage in result.stages] == ["env_feedback"]
    record = RunRecord.of(read_typed_events(run))
    assert record.start is not None
    assert record.start.model == "client 1.0"
    assert read_document(run)["author"] == "client 1.0"
    assert replay(run, print) is None
    (run / "result.json").unlink()
    told: list[str] = []
    again = resume(run, RunOptions(told.append))
    assert told == ["client 1.0 cannot be asked again; what it did counts"]
    timeless = {"seconds": 0.0, "worker_seconds": 0.0}
    assert again.model_copy(update=timeless) == result.model_copy(update=timeless)


@pytest.mark.slow
def test_what_a_killed_worker_did_counts(tmp_path: Path) -> None:
    config = build_config(
        {"task": "movement", "workflow": "tools", "settings": {"max_simulations": 3}}
    )

    async def simulate(bench: Bench, _stage: StageName) -> None:
        checked = await bench.call("check", {"machine": CAR})
        name = checked.data["machine"]
        edited = await bench.call("edit", {"machine": name, "script": "Remove 6"})
        for machine in (edited.data["machine"], name):
            await bench.call("simulate", {"machine": machine})
        raise KeyboardInterrupt

    workflow = workflow_of(simulate, "client 1.0", (FEEDBACK,))
    with pytest.raises(InterruptedRunError):
        design(config, tmp_path, RunOptions(workflow=workflow), "run")
    result = resume(tmp_path / "run")
    assert result.score > 40
    assert result.rollouts == 2
    assert result.verified_score > 40
    assert replay(tmp_path / "run", print) is None
