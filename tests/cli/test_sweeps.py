"""`agentflow sweep` and `agentflow table` as a user types them."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
import yaml
from rich.console import Console

from agentflow.cli import main
from agentflow.cli.display.sweep_live import SweepView
from agentflow.runs.events import StageBeginEvent
from agentflow.runs.locations import Location
from tests.app.sweeps.test_run import DEAD, TINY
from tests.metrics.events import evaluation
from tests.runs.results import a_result

Captured = pytest.CaptureFixture[str]

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep in which one run works and one cannot reach its endpoint; exit 3."""
    folder = tmp_path_factory.mktemp("my sweeps")
    axes = {"condition": {"lives": {}, "dead": DEAD}}
    (folder / "mixed.yaml").write_text(yaml.safe_dump({**TINY, "seeds": [0], "axes": axes}))
    assert (
        main(["sweep", str(folder / "mixed.yaml"), "--out", str(folder), "--quiet", "--trust"]) == 3
    )
    return folder


@pytest.mark.slow
def test_a_partly_failed_sweep_says_what_failed_and_how_to_go_on(
    folder: Path, capsys: Captured
) -> None:
    path = folder / "mixed"
    assert (
        main(["sweep", str(folder / "mixed.yaml"), "--out", str(folder), "--resume", "--trust"])
        == 3
    )
    out, told = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0] == f"1 of 2 runs done: {path}"
    assert lines[1].startswith("failed: dead.seed-0: no answer from http://127.0.0.1:9/v1")
    assert lines[2:] == [
        f"retry the failed runs with: agentflow sweep '{path}' --resume --trust",
        f"compare them with: agentflow table '{path}'",
    ]
    assert told.splitlines()[0] == "dead.seed-0: started"
    assert told.splitlines()[-1].startswith("agentflow: dead.seed-0: failed: no answer from")


@pytest.mark.slow
def test_the_outcome_as_json_is_alone_on_stdout(folder: Path, capsys: Captured) -> None:
    assert main(["sweep", str(folder / "mixed"), "--resume", "--trust", "--json", "--quiet"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert found["sweep"] == str(folder / "mixed")
    assert found["done"] == ["lives.seed-0"]
    assert list(found["failed"]) == ["dead.seed-0"]


def test_when_no_run_reaches_its_endpoint_the_status_says_so(tmp_path: Path) -> None:
    axes = {"condition": {"dead": DEAD}}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump({**TINY, "seeds": [0], "axes": axes}))
    assert (
        main(["sweep", str(tmp_path / "x.yaml"), "--out", str(tmp_path), "--quiet", "--trust"]) == 4
    )


@pytest.mark.slow
def test_a_sweep_is_not_begun_twice(folder: Path, capsys: Captured) -> None:
    assert main(["sweep", str(folder / "mixed.yaml"), "--out", str(folder), "--trust"]) == 2
    assert capsys.readouterr().err == (
        f"agentflow: {folder / 'mixed'} already holds this sweep: resume it with --resume, or "
        "choose another folder with --out\n"
    )


def test_tables_say_what_is_missing(folder: Path, capsys: Captured) -> None:
    assert main(["table", str(folder / "mixed")]) == 0
    out = capsys.readouterr().out
    assert out.startswith("Tiny\n")
    (row,) = (line for line in out.splitlines() if line.startswith("movement"))
    assert row.split()[4:8] == ["-", "-", "-", "2/2"]  # those of the dead condition first
    assert "INCOMPLETE: 1 of 2 runs are missing, 1 of them failed.\n" in out
    assert main(["table", str(folder / "mixed"), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["measured"][0]["task"] == "movement"


def test_a_dry_run_lists_runs_and_costs_and_writes_nothing(
    tmp_path: Path, capsys: Captured
) -> None:
    words = ["sweep", str(ROOT / "configs/inspector.yaml"), "--seeds", "1", "--dry-run"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out == (
        "baseline.seed-0: 49 calls, 16 rollouts and 9 for verification\n"
        "no_inspector.seed-0: 41 calls, 16 rollouts and 9 for verification\n"
        "2 runs to do: about 90 calls (excluding retries), at most 32 rollouts and 18 for "
        "verification, about 6 s with 2 workers. No tokens and no cost, because the "
        "procedural model is used.\n"
    )
    price = "model.prices={m: {input: 1, output: 2}}"
    assert main([*words, "--model", "m", "--set", price, "--workers", "4"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "2 runs to do: about 90 calls (excluding retries), at most 32 rollouts and 18 for "
        "verification, about 3 s with 4 workers, plus the time of the model calls. "
        "About 333280 tokens, excluding reasoning; cost 0.35."
    )
    assert main([*words, "--model", "m", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["left"]["money"] is None
    assert [run["run"] for run in found["runs"]] == ["baseline.seed-0", "no_inspector.seed-0"]
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_of_very_many_runs_takes_seeds_together(tmp_path: Path, capsys: Captured) -> None:
    words = ["sweep", str(ROOT / "configs/inspector.yaml"), "--seeds", "2000", "--dry-run"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        f"{name}.seed-0 ... {name}.seed-1999: 2000 runs, 0 done, {calls} calls, "
        "16 rollouts and 9 for verification each"
        for name, calls in (("baseline", 49), ("no_inspector", 41))
    ]


def test_a_dry_run_does_not_count_runs_of_other_seeds(tmp_path: Path, capsys: Captured) -> None:
    done = tmp_path / "inspector" / "runs" / "baseline.seed-5"
    done.mkdir(parents=True)
    (done / "result.json").touch()
    words = ["sweep", str(ROOT / "configs/inspector.yaml"), "--seeds", "1", "--dry-run"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("2 runs to do: about 90 calls ")


def test_a_dry_run_counts_what_is_done(folder: Path, capsys: Captured) -> None:
    assert main(["sweep", str(folder / "mixed"), "--dry-run"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "lives.seed-0: done" in lines
    assert lines[-1].startswith("1 run to do: about 12 calls (excluding retries), ")  # of DEAD


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sweep", "none.yaml"], "cannot read none.yaml: No such file or directory"),
        (["sweep", "configs/small.yaml"], "configs/small.yaml is not a sweep: it has neither "),
        (["sweep", "configs"], "cannot read configs: Is a directory"),
        (
            ["sweep", "configs/inspector.yaml", "--set", "inspector=off"],
            "inspector is varied by the sweep (condition) and cannot be set for all runs; "
            "to set the seeds, use --seeds N",
        ),
        (["table", "configs"], "configs is not a sweep directory: it has no readable sweep.yaml"),
    ],
)
def test_bad_input_is_one_line(
    words: list[str], message: str, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(words) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")


def test_the_live_view_has_a_line_per_run_and_fits_the_terminal() -> None:
    console = Console(file=io.StringIO(), width=80, height=10, force_terminal=False)
    view = SweepView(40, console)
    for number in range(20):
        view.run_started(f"run-{number}")
        view.event(f"run-{number}", StageBeginEvent(Location("initial"), 1))
        view.event(f"run-{number}", evaluation("initial/traj-1", number + 0.5))
        if number < 18:
            view.run_finished(f"run-{number}", a_result(score=number + 0.5))
    view.run_failed("run-3", "nothing answers")
    console.print(view.draw())
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert lines[0] == "17 done · 1 failed · 2 running · 20 waiting · 0 s"
    assert [line.split()[:2] for line in lines[2:]] == [
        ["run-3", "failed"],
        ["run-17", "done"],
        ["run-18", "running"],
        ["run-19", "running"],
    ]
    assert all(len(line) <= 80 for line in lines)
    assert "19.50" in lines[-1]


@pytest.mark.slow
def test_an_endpoint_answers_for_a_whole_sweep(
    stub_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    """A foreign server; what it is sent and what it costs is the runs' own record."""
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret-of-a-test")
    base = {"task": "movement", "workflow": "single", "max_retry": 1, "workers": 1}
    small = {"settings": {"trajectories": 2, "search": {"rounds": 0}}}
    document = {**TINY, "seeds": [0], "base": {**base, **small}}
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(document))
    words = ["sweep", str(tmp_path / "x.yaml"), "--out", str(tmp_path), "--quiet", "--json"]
    model = ["--model", "some/model", "--base-url", stub_url, "--jobs", "4"]
    limits = ["--set", "model.endpoint.limits.concurrent=1"]
    assert main([*words, *model, *limits]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "sweep": str(tmp_path / "x-some-model"),
        "done": ["one.seed-0", "other.seed-0"],
        "failed": {},
    }
    assert (
        main(["table", str(tmp_path / "x-some-model"), "--show", "usage", "--format", "csv"]) == 0
    )
    rows = [line.split(",") for line in capsys.readouterr().out.splitlines()]
    assert [row[4:6] for row in rows if row[4] == "all"] == [["all", "2"]] * 2
    assert rows[1][:3] == ["measured", "movement", "some/model"]
    for path in (tmp_path / "x-some-model").rglob("*"):
        if path.is_file():
            assert b"sk-secret" not in path.read_bytes()
