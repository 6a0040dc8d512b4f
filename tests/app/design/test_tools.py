"""Runs of the workflow `tools`: recorded, replayed, killed, resumed, shown."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import RunOptions, design, resume
from agentflow.app.inspect.overview import run_details
from agentflow.config.run import build_config
from agentflow.runs import Event, read_document
from agentflow.runs.events import ToolEvent

SETTINGS = {"max_simulations": 5, "candidates_per_stage": 1, "vision": True}
CONFIG = {"task": "movement", "workflow": "tools", "settings": SETTINGS, "verify": False}


class Killed(BaseException):
    """Ends a run at once, as a kill does."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small run with the procedural model on real physics."""
    return Path(design(build_config(CONFIG), tmp_path_factory.mktemp("runs")).run)


@pytest.mark.slow
def test_a_run_with_tools_replays_identically(run: Path) -> None:
    assert replay(run, pytest.fail) is None


@pytest.mark.slow
def test_its_details_count_calls_of_tools_by_stage(run: Path) -> None:
    details = run_details(run)
    assert details["score"] > 40
    counts = {stage["name"]: stage["tools"] for stage in details["stages"]}
    assert counts["initial"] == {
        "check": {"calls": 1, "refused": 0},
        "submit": {"calls": 1, "refused": 0},
    }
    assert counts["env_feedback"]["simulate"]["calls"] >= 3
    assert sum(stage["rollouts"] for stage in details["stages"]) == 5


@pytest.mark.slow
@pytest.mark.parametrize("after", [2, 14])
def test_a_killed_run_with_tools_resumes_to_the_same_result(
    run: Path, tmp_path: Path, after: int
) -> None:
    left = [after]

    def kill(event: Event) -> None:
        left[0] -= event.kind == ToolEvent.kind
        if left[0] < 0:
            raise Killed

    with pytest.raises(Killed):
        design(build_config(CONFIG), tmp_path, RunOptions(listener=kill), "run")
    path = tmp_path / "run"
    result = resume(path)
    whole = json.loads((run / "result.json").read_text())
    timed = {"run", "seconds", "worker_seconds"}
    assert {k: v for k, v in result.to_json().items() if k not in timed} == {
        k: v for k, v in whole.items() if k not in timed
    }
    assert replay(path, pytest.fail) is None


@pytest.mark.slow
def test_prompts_of_agents_are_a_condition_of_their_runs_only(run: Path, tmp_path: Path) -> None:
    other = {"task": "movement", "workflow": "random-dsl", "settings": {"max_simulations": 1}}
    plain = design(build_config({**other, "verify": False}), tmp_path).run
    assert read_document(Path(plain))["prompts"] != read_document(run)["prompts"]
