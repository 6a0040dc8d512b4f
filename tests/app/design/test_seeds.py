"""Several seeds, one after another: the best run, a row for each, and a limit of time."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.app.design import seeds
from agentflow.app.design.run import RunOptions, design
from agentflow.app.design.seeds import _rank, design_seeds
from agentflow.cli import main
from agentflow.config.run import DesignConfig, build_config
from agentflow.errors import EndpointError, RunError, UnreachableError
from agentflow.llm.messages import Request
from agentflow.runs import RunResult, read_document, read_result
from tests.machine.builders import CAR
from tests.runs.results import a_result
from tests.scripted import ScriptedClient

TINY = {
    "task": "movement",
    "knobs": {"window": 1},
    "workflow": "random-dsl",
    "workers": 1,
    "seed": 4,
    "verify": False,
    "settings": {"trajectories": 2, "max_simulations": 2},
}
Captured = pytest.CaptureFixture[str]


def clock(*minutes: float) -> object:
    """A clock that shows one time after the other."""
    times = iter(minutes)
    return lambda: 60 * next(times)


@pytest.mark.slow
def test_the_best_of_the_seeds_is_returned_with_all_of_them(tmp_path: Path) -> None:
    told: list[str] = []
    found = design_seeds(build_config(TINY), tmp_path, 3, None, RunOptions(told.append))
    rows = found.rows
    assert [row["seed"] for row in rows] == [4, 5, 6]
    assert told == [f"seed {seed}: run {n} of 3" for n, seed in enumerate((4, 5, 6), start=1)]
    results = [read_result(Path(row["run"])) for row in rows]
    assert [row["score"] for row in rows] == [result.score for result in results]
    assert [read_document(Path(row["run"]))["config"]["seed"] for row in rows] == [4, 5, 6]
    assert found.best == max(results, key=lambda result: result.score or float("-inf"))
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        Path(row["run"]).name for row in rows
    )


@pytest.mark.slow
def test_no_run_begins_when_the_time_is_over(tmp_path: Path) -> None:
    told: list[str] = []
    options = RunOptions(told.append)
    times = clock(0.0, 9.0, 11.0)
    found = design_seeds(build_config(TINY), tmp_path, 5, 10, options, times)  # type: ignore[arg-type]
    assert [row["seed"] for row in found.rows] == [4, 5]
    assert told[-1] == "10 minutes are over: 3 seeds not run"


def failing(told: list[str], *seeds: int) -> ScriptedClient:
    """A client that designs a car, but does not answer in the runs of these seeds."""

    def answer(_request: Request) -> str:
        latest = next(line for line in reversed(told) if ": run " in line)
        if int(latest.removeprefix("seed ").partition(":")[0]) in seeds:
            raise UnreachableError("no answer from the endpoint\nsecond line")
        return CAR.to_text()

    return ScriptedClient(answer)


SINGLE = {**TINY, "workflow": "single", "settings": {"trajectories": 1}}


@pytest.mark.slow
def test_a_failed_run_is_named_and_stops_no_other(tmp_path: Path) -> None:
    told: list[str] = []
    options = RunOptions(told.append, client=failing(told, 4, 6))
    found = design_seeds(build_config(SINGLE), tmp_path, 4, None, options)
    assert (found.best.seed, found.best.valid) == (5, True)
    failed, good, also, last = found.rows
    assert [row["seed"] for row in found.rows] == [4, 5, 6, 7]
    assert failed == {
        **dict.fromkeys(good, None),
        "seed": 4,
        "failed": "no answer from the endpoint",
    }
    assert (also["failed"], also["score"]) == ("no answer from the endpoint", None)
    assert (good["failed"], last["failed"]) == ("", "")
    assert good["score"] == last["score"] == found.best.score
    assert "seed 6 failed: no answer from the endpoint" in told


def test_a_series_in_which_all_runs_fail_is_an_error_that_names_each(tmp_path: Path) -> None:
    told: list[str] = []
    options = RunOptions(told.append, client=failing(told, 4, 5))
    with pytest.raises(EndpointError) as caught:
        design_seeds(build_config(SINGLE), tmp_path, 2, None, options)
    reason = "no answer from the endpoint"
    assert str(caught.value) == f"no run finished: seed 4: {reason}; seed 5: {reason}"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_exit_status_says_whether_some_runs_failed_or_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    def unreliable(config: DesignConfig, out: Path, options: RunOptions) -> RunResult:
        if config.seed == broken:
            raise RunError("no space left")
        return design(config, out, options)

    monkeypatch.setattr(seeds, "design", unreliable)
    config = tmp_path / "tiny.yaml"
    config.write_text(json.dumps(TINY))
    arguments = ["design", "--config", str(config), "--out", str(tmp_path / "runs"), "--quiet"]
    broken = 5
    assert main([*arguments, "--seeds", "2"]) == 3
    _, row, failed, *_ = capsys.readouterr().out.splitlines()
    assert (row.split()[0], failed) == ("4", "seed 5 failed: no space left")
    broken = 4
    assert main([*arguments, "--seeds", "1"]) == 2
    assert capsys.readouterr().err == "agentflow: no run finished: seed 4: no space left\n"
    url, once = "http://127.0.0.1:9/v1", "model.endpoint.retry.attempts=1"
    model = ["--model", "m", "--base-url", url, "--set", once, "--workflow", "single"]
    assert main([*arguments, *model, "--seeds", "2", "--seed", "7"]) == 4
    told = capsys.readouterr()
    assert told.out == ""
    assert "no run finished: seed 7: no answer from" in told.err
    assert "; seed 8: no answer from" in told.err


def test_the_verified_score_decides_and_no_score_comes_last() -> None:
    def result(score: float | None, verified: float | None = None) -> RunResult:
        scores = [{"variation": "default", "status": "ok", "score": score}]
        told = {"score": verified, "low": verified, "high": verified, "scores": scores}
        return a_result(score=score, verified=None if verified is None else told)

    ranked = [result(None), result(9.0), result(9.5, 2.0), result(3.0, 2.5)]
    assert [_rank(item) for item in ranked] == sorted(map(_rank, ranked))
    assert _rank(result(-1.0)) > _rank(result(None))


@pytest.mark.slow
def test_the_summary_names_every_run(tmp_path: Path, capsys: Captured) -> None:
    config = tmp_path / "tiny.yaml"
    config.write_text(json.dumps(TINY))
    arguments = ["design", "--config", str(config), "--seeds", "2", "--out", str(tmp_path / "runs")]
    assert main([*arguments, "--quiet", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [row["seed"] for row in found["seeds"]] == [4, 5]
    drawn = [path.parent for path in (tmp_path / "runs").glob("*/best.png")]
    assert drawn == ([Path(found["run"])] if found["valid"] else [])
    assert main([*arguments, "--minutes", "9"]) == 0
    told = capsys.readouterr()
    head, *rows = told.out.splitlines()[:3]
    assert head.split()[:3] == ["seed", "score", "verified"]
    assert [row.split()[0] for row in rows] == ["4", "5"]
    assert "agentflow: seed 5: run 2 of 2\n" in told.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--minutes", "5"], "--minutes limits the runs of --seeds; give their number, as in"),
        (["--resume", "x", "--seeds", "2"], "--resume uses the settings of the run; remove the"),
        (["--seeds", "0"], "Invalid value for '--seeds': "),
    ],
)
def test_wrong_options_are_refused(options: list[str], message: str, capsys: Captured) -> None:
    assert main(["design", *options]) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")
