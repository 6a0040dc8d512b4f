"""A sweep from end to end: real runs without a model, failures, resumption."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from agentflow.app.design.replay import replay
from agentflow.app.sweeps.plan import plan_sweep, sweep_folder
from agentflow.app.sweeps.run import SweepOutcome, run_blocking, run_sweep_async
from agentflow.app.sweeps.views import view
from agentflow.env.physics.engines import default_engine
from agentflow.errors import ConfigError, RunError, UnknownNameError, UsageError
from agentflow.files.atomic import os_errors
from agentflow.files.lines import LineFile
from agentflow.metrics.intervals import Rate
from agentflow.runs import Event, RunResult, read_result
from agentflow.runs.reading import document_text

ENGINE = default_engine().identity
TINY: dict[str, Any] = {
    "title": "Tiny",
    "base": {
        "task": "movement",
        "workflow": "random-dsl",
        "workers": 1,
        "settings": {"trajectories": 2, "max_simulations": 2},
    },
    "seeds": [0, 1],
    "axes": {"condition": {"one": {"history": True}, "other": {"history": False}}},
    "table": {"stage": "initial", "metrics": ["valid", "mean", "max"]},
}
"""Runs with the same machines: the varied setting has no effect without a model."""
DEAD = {
    "workflow": "single",
    "model.name": "nobody",
    "model.base_url": "http://127.0.0.1:9/v1",
    "model.endpoint.retry.attempts": 1,
}


class Notes:
    """A watcher that records everything."""

    def __init__(self) -> None:
        self.said: list[tuple[str, str]] = []
        self.events = 0

    def run_started(self, run: str) -> None:
        self.said.append(("begun", run))

    def event(self, run: str, event: Event) -> None:  # noqa: ARG002
        self.events += 1

    def remark(self, run: str, line: str) -> None:
        self.said.append((line, run))

    def run_finished(self, run: str, result: RunResult) -> None:
        assert result.rollouts == 2
        self.said.append(("ended", run))

    def run_failed(self, run: str, reason: str) -> None:
        self.said.append((reason, run))


class Clumsy(Notes):
    """Fails at the first event of one run, like a bug in that run."""

    def event(self, run: str, event: Event) -> None:
        assert run != "one.seed-0", "a bug"
        super().event(run, event)


def write(folder: Path, **changes: Any) -> Path:
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump({**TINY, **changes}))
    return path


def carry_out(
    path: Path, out: Path, watcher: Notes | None = None, *, resume: bool = False
) -> SweepOutcome:
    plan = plan_sweep(path, (), {}, approve=lambda _sentence: True)
    folder = sweep_folder(plan, path, out)
    work = run_sweep_async(plan, folder, watcher or Notes(), jobs=2, resume=resume)
    return run_blocking(work, plan, folder)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[SweepOutcome, Notes, Path]:
    folder = tmp_path_factory.mktemp("sweep")
    notes = Notes()
    path = write(folder)
    return carry_out(path, folder / "out", notes), notes, path


RUNS = ("one.seed-0", "one.seed-1", "other.seed-0", "other.seed-1")


@pytest.mark.slow
def test_every_run_is_an_ordinary_run(swept: tuple[SweepOutcome, Notes, Path]) -> None:
    outcome, notes, _ = swept
    assert (outcome.done, outcome.failed) == (RUNS, {})
    assert outcome.path.name == "tiny"
    assert replay(outcome.path / "runs" / RUNS[-1], pytest.fail) is None
    assert {kind for kind, _ in notes.said} == {"begun", "ended"}
    assert notes.events > 4 * 5


@pytest.mark.slow
def test_machines_and_rollouts_are_stored_once(swept: tuple[SweepOutcome, Notes, Path]) -> None:
    outcome, _, _ = swept
    store = outcome.path / "store"
    varied = 2 * 9  # simulations that verify the best machine of each seed, two for its springs
    assert len(list((store / "rollouts").iterdir())) == 4 + varied  # 2 seeds with 2 machines each
    machines = list((store / "machines").iterdir())
    assert len(machines) == 4
    assert {machine.stat().st_nlink for machine in machines} == {3}
    kept = list((outcome.path / "runs").rglob("*.npz"))
    assert len(kept) == 4
    assert {path.stat().st_nlink for path in kept} == {3}


@pytest.mark.slow
def test_the_best_machine_of_every_run_is_verified_unless_switched_off(
    swept: tuple[SweepOutcome, Notes, Path], tmp_path: Path
) -> None:
    outcome, _, _ = swept
    without = carry_out(write(tmp_path, base={**TINY["base"], "verify": False}), tmp_path)
    share = {
        name: view(path, "verified") for name, path in (("on", outcome.path), ("off", without.path))
    }
    assert [row.values[0] for row in share["on"].rows] == [Rate(2, 2), Rate(2, 2)]
    assert [row.values[0] for row in share["off"].rows] == [Rate(0, 2), Rate(0, 2)]
    for name in RUNS:
        found = read_result(outcome.path / "runs" / name)
        plain = read_result(without.path / "runs" / name)
        assert plain.verified is None
        assert found.verified.scores[0].score == found.score == plain.score
    assert len(list((without.path / "store" / "rollouts").iterdir())) == 4


@pytest.mark.slow
def test_a_finished_sweep_is_not_run_again(swept: tuple[SweepOutcome, Notes, Path]) -> None:
    outcome, _, path = swept
    before = {p: p.stat().st_mtime_ns for p in outcome.path.rglob("*") if p.is_file()}
    notes = Notes()
    again = carry_out(path, outcome.path.parent, notes, resume=True)
    assert (again.done, notes.said) == (RUNS, [])
    assert before == {p: p.stat().st_mtime_ns for p in outcome.path.rglob("*") if p.is_file()}
    from_folder = carry_out(outcome.path, Path("nowhere"), notes, resume=True)
    assert (from_folder.path, from_folder.done, notes.said) == (outcome.path, RUNS, [])


@pytest.mark.slow
def test_a_sweep_is_resumed_only_on_request_and_unchanged(
    swept: tuple[SweepOutcome, Notes, Path], tmp_path: Path
) -> None:
    outcome, _, path = swept
    with pytest.raises(RunError) as caught:
        carry_out(path, outcome.path.parent)
    assert str(caught.value) == (
        f"{outcome.path} already holds this sweep: resume it with --resume, or choose another "
        "folder with --out"
    )
    other = write(tmp_path, base={**TINY["base"], "settings": {"trajectories": 3}})
    with pytest.raises(RunError) as caught:
        carry_out(other, outcome.path.parent, resume=True)
    assert str(caught.value) == (
        f"{outcome.path} was started with a different base.settings.trajectories: resume it "
        f"unchanged with agentflow sweep {outcome.path} --resume, or choose another folder with "
        "--out"
    )


@pytest.mark.slow
def test_unfinished_and_half_created_runs_are_carried_out(
    swept: tuple[SweepOutcome, Notes, Path], tmp_path: Path
) -> None:
    """After a kill: a run without result, a folder without run.yaml, a run not started."""
    outcome, _, path = swept
    copy = shutil.copytree(outcome.path, tmp_path / "tiny")
    expected = json.loads((copy / "runs" / RUNS[0] / "result.json").read_text())
    (copy / "runs" / RUNS[0] / "result.json").unlink()
    shutil.rmtree(copy / "runs" / RUNS[1])
    (copy / "runs" / RUNS[1]).mkdir()
    (copy / "runs" / RUNS[1] / ".123-run.yaml").write_text("sch")
    shutil.rmtree(copy / "runs" / RUNS[2])
    with (copy / "members.jsonl").open("a") as log:
        log.write('{"run": "one')
    notes = Notes()
    again = carry_out(path, tmp_path, notes, resume=True)
    assert (again.done, again.failed) == (RUNS, {})
    assert {run for kind, run in notes.said if kind == "begun"} == set(RUNS[:3])
    found = json.loads((copy / "runs" / RUNS[0] / "result.json").read_text())
    clock = {"seconds", "run"}
    assert found["cost"] == 0
    assert {k: v for k, v in found.items() if k not in clock} == {
        k: v for k, v in expected.items() if k not in clock
    }
    lines = [json.loads(line) for line in (copy / "members.jsonl").read_text().splitlines()]
    assert [line["state"] for line in lines] == ["done"] * 7


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("prompts", "0" * 16, "prompts"),
        ("engine", f"{ENGINE.name} 0.0.1", f"engine ({ENGINE.name} 0.0.1, now {ENGINE.version})"),
    ],
)
def test_a_sweep_with_runs_under_other_conditions_is_refused(
    swept: tuple[SweepOutcome, Notes, Path], tmp_path: Path, name: str, value: str, words: str
) -> None:
    outcome, _, path = swept
    copy = shutil.copytree(outcome.path, tmp_path / "tiny")
    shutil.rmtree(copy / "runs" / RUNS[3])
    file = copy / "runs" / RUNS[1] / "run.yaml"
    file.write_text(document_text({**yaml.safe_load(file.read_text()), name: value}))
    with pytest.raises(RunError) as caught:
        carry_out(path, tmp_path, resume=True)
    assert str(caught.value) == (
        f"{copy}: {RUNS[1]} was made with different {words}: the remaining runs would not be "
        "comparable; choose another folder with --out"
    )
    assert not (copy / "runs" / RUNS[3]).exists()


@pytest.mark.slow
def test_resuming_a_sweep_with_another_engine_is_refused(
    swept: tuple[SweepOutcome, Notes, Path], tmp_path: Path
) -> None:
    outcome, _, path = swept
    copy = shutil.copytree(outcome.path, tmp_path / "tiny")
    document = yaml.safe_load((copy / "sweep.yaml").read_text())
    assert document["engine"] == str(ENGINE)
    (copy / "sweep.yaml").write_text(yaml.safe_dump({**document, "engine": "other 1"}))
    with pytest.raises(RunError) as caught:
        carry_out(path, tmp_path, resume=True)
    assert str(caught.value) == (
        f"{copy} was started with different engine (other 1, now {ENGINE}): further "
        "runs would not be comparable; choose another folder with --out"
    )
    del document["engine"]
    (copy / "sweep.yaml").write_text(yaml.safe_dump(document))
    assert carry_out(path, tmp_path, resume=True).failed == {}


@pytest.mark.slow
def test_failed_runs_are_recorded_and_stop_no_other_run(tmp_path: Path) -> None:
    path = write(tmp_path, seeds=[0], axes={"condition": {"lives": {}, "dead": DEAD}})
    outcome = carry_out(path, tmp_path)
    assert outcome.done == ("lives.seed-0",)
    assert list(outcome.failed) == ["dead.seed-0"]
    assert "http://127.0.0.1:9/v1" in outcome.failed["dead.seed-0"]
    assert outcome.endpoint
    lines = [
        json.loads(line) for line in (tmp_path / "tiny/members.jsonl").read_text().splitlines()
    ]
    assert {line["run"]: line["state"] for line in lines} == {
        "lives.seed-0": "done",
        "dead.seed-0": "failed",
    }
    notes = Notes()
    again = carry_out(path, tmp_path, notes, resume=True)
    assert (again.done, list(again.failed)) == (outcome.done, list(outcome.failed))
    assert ("begun", "lives.seed-0") not in notes.said


@pytest.mark.slow
def test_a_bug_in_one_run_is_logged_in_full_and_the_run_can_resume(tmp_path: Path) -> None:
    path = write(tmp_path, seeds=[0])
    outcome = carry_out(path, tmp_path, Clumsy())
    assert outcome.done == ("other.seed-0",)
    assert outcome.failed == {"one.seed-0": "AssertionError: a bug"}
    assert not outcome.endpoint
    log = (tmp_path / "tiny" / "members.jsonl").read_text().splitlines()
    (failed,) = (item for item in map(json.loads, log) if item["state"] == "failed")
    assert failed["traceback"].startswith("Traceback (most recent call last):")
    assert carry_out(path, tmp_path, resume=True).failed == {}


def test_a_model_in_a_folder_is_no_name_at_an_endpoint(tmp_path: Path) -> None:
    path, folder = write(tmp_path), tmp_path / "model"
    folder.mkdir()
    (folder / "config.json").write_text("{}")
    plan = plan_sweep(path, [], {"model.name": str(folder)})
    assert {run.config.model.label for run in plan.runs} == {"model"}
    names = {"here": str(folder), "there": "gpt-y", "rules": "procedural"}
    axes = {"condition": {label: {"model.name": name} for label, name in names.items()}}
    for given in ({}, {"model.label": "of the base"}):
        plan = plan_sweep(write(tmp_path, axes=axes), [], given)
        labels = {run.labels["condition"]: run.config.model.label for run in plan.runs}
        assert labels == {"here": "model", "there": None, "rules": None}


def test_a_folder_may_have_the_name_of_the_built_in_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "procedural").mkdir()
    monkeypatch.chdir(tmp_path)
    assert plan_sweep(write(tmp_path), [], {}).runs


def test_settings_apply_to_all_runs_and_name_the_folder(tmp_path: Path) -> None:
    path = write(tmp_path)
    plan = plan_sweep(path, ["trajectories=5"], {"model.name": "a/b c"}, seeds=3)
    assert {run.config.settings.trajectories for run in plan.runs} == {5}
    assert {run.config.model.name for run in plan.runs} == {"a/b c"}
    assert [run.config.seed for run in plan.runs] == [0, 1, 2] * 2
    assert sweep_folder(plan, path, Path("out")) == Path("out/tiny-a-b-c")


@pytest.mark.parametrize(
    ("settings", "changes", "kind", "message"),
    [
        (["history=off"], {}, ConfigError, "history is varied by the sweep (condition) and "),
        (["settings.history=off"], {}, ConfigError, "settings.history is varied by the sweep"),
        (["seed=3"], {}, ConfigError, "seed is varied by the sweep (seeds) and cannot be set"),
        (
            [],
            {"table": {"metrics": ["meen"]}},
            UnknownNameError,
            "unknown metric 'meen'; known: mean",
        ),
        (
            [],
            {"table": {"metrics": ["mean"], "published": [{"table": "inspectr"}]}},
            UnknownNameError,
            "unknown published table 'inspectr'; known: inspector",
        ),
        ([], {"base": {"task": "thowing"}}, UnknownNameError, "unknown task 'thowing'; known: thr"),
        ([], {"base": {"workflow": "x"}}, UnknownNameError, "unknown workflow 'x'; known: "),
        ([], {"base": {"prompts": "x"}}, UsageError, "unknown prompt set 'x'; known: "),
    ],
)
def test_wrong_sweeps_are_refused_before_anything_is_written(
    tmp_path: Path, settings: list[str], changes: dict[str, Any], kind: type, message: str
) -> None:
    with pytest.raises(kind) as caught:
        plan_sweep(write(tmp_path, **changes), settings, {})
    assert str(caught.value).startswith(message)


@pytest.mark.slow
def test_an_existing_sweep_refuses_other_settings(swept: tuple[SweepOutcome, Notes, Path]) -> None:
    outcome, _, _ = swept
    with pytest.raises(UsageError) as caught:
        plan_sweep(outcome.path, ["trajectories=1"], {})
    assert str(caught.value) == (
        f"{outcome.path} is resumed with its own settings; remove --model, --base-url, --engine, "
        "--set and --seeds"
    )


@pytest.mark.slow
def test_a_sweep_can_be_resumed_after_ctrl_c(tmp_path: Path) -> None:
    base = {**TINY["base"], "settings": {"trajectories": 8, "max_simulations": 24}}
    path = write(tmp_path, base=base)
    command = [sys.executable, "-c", "import sys; from agentflow.cli import main; sys.exit(main())"]
    words = ["sweep", str(path), "--out", str(tmp_path / "out")]
    process = subprocess.Popen(
        [*command, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    rollouts = tmp_path / "out" / "tiny" / "store" / "rollouts"
    deadline = time.monotonic() + 60
    while not (rollouts.exists() and len(list(rollouts.iterdir())) >= 5):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGINT)
    out, told = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert told.splitlines()[-1] == (
        f"agentflow: interrupted; 0 of 4 runs are done; continue with: agentflow sweep "
        f"{tmp_path / 'out' / 'tiny'} --resume"
    )
    again = subprocess.run(
        [*command, "sweep", str(tmp_path / "out" / "tiny"), "--resume", "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(again.stdout)["done"] == list(RUNS)


@pytest.mark.parametrize("url", ["https://user:secret@host/v1", "https://host/v1?key=secret"])
@pytest.mark.parametrize("keys", [["model.base_url"], ["model", "base_url"]])
def test_credentials_in_axes_are_refused(tmp_path: Path, url: str, keys: list[str]) -> None:
    setting: Any = url
    for key in reversed(keys):
        setting = {key: setting}
    path = write(tmp_path, axes={"where": {"there": setting}})
    with pytest.raises(ConfigError) as caught:
        plan_sweep(path, (), {})
    assert str(caught.value) == (
        "an axis has a base URL with a user name or a query string, which may contain an API key "
        "and would be written to files; put the key in an environment variable and name that "
        "variable in model.key_variable"
    )


class Full(Notes):
    """A disk without space, from the first event of one run on."""

    def event(self, run: str, event: Event) -> None:
        with os_errors("cannot write events.jsonl"):
            if run == "one.seed-0":
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        super().event(run, event)


@pytest.mark.slow
def test_a_full_disk_says_what_to_free_and_leaves_resuming_to_the_sweep(tmp_path: Path) -> None:
    outcome = carry_out(write(tmp_path, seeds=[0]), tmp_path / "out", Full())
    assert outcome.failed == {
        "one.seed-0": "cannot write events.jsonl: No space left on device; free some space"
    }


@pytest.mark.slow
def test_a_sweep_that_cannot_write_its_log_says_how_to_continue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(LineFile):
        def append(self, _line: bytes) -> None:
            raise RunError("no space left")

    monkeypatch.setattr("agentflow.app.sweeps.run.LineFile", Full)
    with pytest.raises(RunError) as error:
        carry_out(write(tmp_path, seeds=[0]), tmp_path / "out")
    folder = next(tmp_path.rglob("sweep.yaml")).parent
    told = f"no space left; continue with: agentflow sweep {folder} --resume"
    assert str(error.value) == told
