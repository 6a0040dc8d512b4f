"""Sweeps and repeated designs from Python, with functions in place of models."""

from __future__ import annotations

import json
import signal
import statistics
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.config.grid import sweep_document
from agentflow.errors import (
    AgentflowError,
    ConfigError,
    InterruptedRunError,
    RunError,
    UsageError,
)
from agentflow.metrics.intervals import bootstrap_mean
from agentflow.notebook.sweeping import EVERY, plan_sweep
from agentflow.runs import Event
from agentflow.runs.events import RunEvent

CAR = (Path(__file__).parents[2] / "examples" / "car.json").read_text()
BASE: Mapping[str, Any] = {
    "task": "movement",
    "window": 1,
    "workflow": "single",
    "trajectories": 1,
    "verify": False,
    "max_retry": 1,
    "search.rounds": 0,
}
asked: list[tuple[str, int | None, str]] = []


def car(request: agentflow.Request) -> str:
    asked.append((request.run, request.run_seed, request.label))
    return CAR


def nothing(_request: agentflow.Request) -> str:
    return "I do not know."


@pytest.mark.slow
async def test_a_grid_compares_functions_and_tells_them_the_run(tmp_path: Path) -> None:
    asked.clear()
    grid = {**BASE, "answer": [car, nothing]}
    async with agentflow.RolloutPool(1) as pool:
        found = await agentflow.sweep_async(grid, seeds=[3, 5], out=tmp_path, name="a", pool=pool)
    assert found.path == tmp_path / "a"
    assert [dict(run.labels) for run in found.runs] == [
        {"answer": "car"},
        {"answer": "car"},
        {"answer": "nothing"},
        {"answer": "nothing"},
    ]
    assert sorted({(run, seed) for run, seed, _ in asked}) == [
        ("car.seed-3", 3),
        ("car.seed-5", 5),
    ]
    assert all(label for _, _, label in asked)
    recorded = [call["request"] for run in found.runs for call in run.calls]
    assert recorded
    assert all(not {"run", "run_seed"} & request.keys() for request in recorded)
    summary = found.summary()
    assert list(summary.answer) == ["car", "nothing"]
    scores = [run.result.score for run in found.runs[:2]]
    assert summary.loc[0, "mean"] == pytest.approx(statistics.fmean(map(float, scores)))  # type: ignore[arg-type]
    assert (summary.loc[1, "mean"], summary.loc[1, "best"]) == (0, 0)
    assert found.best is not None
    assert found.best.labels == {"answer": "car"}
    frame = found.to_frame()
    assert list(frame.columns[:3]) == ["answer", "run", "seed"]
    assert set(frame[frame.answer == "nothing"].validity) == {"invalid"}
    with pytest.raises(RunError, match="already holds this sweep"):
        await agentflow.sweep_async(grid, seeds=[3, 5], out=tmp_path, name="a")
    again = await agentflow.sweep_async(grid, seeds=[3, 5], out=tmp_path, name="a", resume=True)
    assert again == found


@pytest.mark.slow
async def test_a_design_with_several_seeds_has_mean_interval_and_best(tmp_path: Path) -> None:
    told: list[str] = []
    async with agentflow.RolloutPool(1) as pool:
        found = await agentflow.design_async(
            settings=BASE, answer=car, seeds=3, out=tmp_path, pool=pool, say=told.append
        )
    assert found.path.parent == tmp_path
    assert found.path.name.endswith("movement-single")
    assert [run.config.seed for run in found.runs] == [0, 1, 2]
    [row] = found.summary_rows()
    scores = [float(run.result.score or 0) for run in found.runs]
    interval = bootstrap_mean(scores)
    assert interval is not None
    assert (row["runs"], row["low"], row["high"]) == (3, *interval)
    assert row["best"] == max(scores)
    assert repr(found) == f"Sweep({str(found.path)!r}, 3 of 3 runs done)"
    assert len(agentflow.load_runs(tmp_path)) == 3
    assert await agentflow.sweep_async(found.path, answer=car, resume=True) == found


def test_what_is_wrong_is_said_before_any_run(tmp_path: Path) -> None:
    cases: list[tuple[Any, dict[str, Any], str]] = [
        ({**BASE, "answer": [car, car]}, {}, "two functions of answer have the same name"),
        ({**BASE, "answer": [car]}, {"answer": nothing}, "give either answer= or the key 'answer'"),
        ({**BASE, "task": []}, {}, "axis task has no values"),
        ({**BASE, "task": ["movement", "movment"]}, {}, "unknown task 'movment'"),
        ({**BASE, "windw": 1}, {"answer": car}, "windw"),
        ({**BASE, "seed": 1}, {"answer": car}, "list seeds under seeds"),
        ("no-such-sweep", {}, "cannot read no-such-sweep"),
        ("small", {}, "is not a sweep"),
    ]
    for config, options, message in cases:
        with pytest.raises(AgentflowError, match=message) as refused:
            agentflow.sweep(config, out=tmp_path, **options)
        assert "\n" not in str(refused.value)
    with pytest.raises(UsageError, match="give either seed= or seeds="):
        agentflow.design(settings=BASE, answer=car, seed=1, seeds=2, out=tmp_path)
    with pytest.raises(UsageError, match="seeds= needs at least one seed"):
        agentflow.design(settings=BASE, answer=car, seeds=[], out=tmp_path)
    with pytest.raises(ConfigError, match="program"):
        agentflow.design("movement", workflow="external", answer=car, seeds=2, out=tmp_path)
    assert not any(tmp_path.iterdir())


async def test_a_sweep_whose_runs_all_fail_says_why(tmp_path: Path) -> None:
    def broken(_request: agentflow.Request) -> str:
        raise ZeroDivisionError("no luck")

    told: list[str] = []
    with pytest.raises(RunError, match=r"every run of .* has failed; seed-0: ZeroDivisionError"):
        await agentflow.sweep_async(BASE, answer=broken, out=tmp_path, say=told.append)
    assert any("seed-0 has failed: ZeroDivisionError: no luck" in line for line in told)
    with pytest.raises(UsageError, match="await sweep_async"):
        agentflow.sweep(BASE, answer=car, out=tmp_path)


def test_ctrl_c_says_how_a_sweep_continues(tmp_path: Path) -> None:
    def interrupt(event: RunEvent | Event) -> None:
        if event.kind == "run":
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(InterruptedRunError) as stopped:
        agentflow.design(
            settings=BASE, answer=car, seeds=2, jobs=1, out=tmp_path, listener=interrupt
        )
    [folder] = tmp_path.iterdir()
    told = "interrupted; 0 of 2 runs are done; continue in Python: agentflow.sweep"
    assert str(stopped.value) == f"{told}({str(folder)!r}, answer=..., resume=True)"


def test_a_sweep_file_keeps_the_name_that_is_given(tmp_path: Path) -> None:
    file = tmp_path / "small.yaml"
    file.write_text(json.dumps({"title": "t", "base": {}, "table": {"metrics": ["mean"]}}))
    given = {"model.name": "mine", "task": "movement"}
    work = plan_sweep(file, car, [3, 4], given, False, tmp_path, "x")
    assert [run.config.seed for run in work.plan.runs] == [3, 4]
    assert {run.config.model.name for run in work.plan.runs} == {"mine"}
    assert work.functions[EVERY].name == "mine"
    assert work.folder == tmp_path / "x"


def test_grids_are_documents_of_sweeps() -> None:
    document, functions = sweep_document(
        {"task": ["a", "b"], "search": {"x": {"search.rounds": 1}}, "max_retry": 2}
    )
    assert document["base"] == {"max_retry": 2}
    assert document["axes"] == {"task": ["a", "b"], "search": {"x": {"search.rounds": 1}}}
    assert functions == {}
    whole = {"title": "t", "axes": {}, "table": {}}
    assert sweep_document(whole) == (whole, {})
    named, functions = sweep_document({"answer": {"first": car, "second": nothing}})
    assert named["axes"]["answer"]["second"] == {"model.name": "second"}
    assert functions == {"first": car, "second": nothing}
    with pytest.raises(ConfigError, match=r"write \{label: function"):
        sweep_document({"answer": [car, car]})
