"""Tasks for Harbor: their files, and their scripts in plain folders in place of containers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import agentflow
from agentflow.cli import main
from agentflow.errors import UsageError
from agentflow.integrations.harbor import export, grade, items_of
from tests.integrations.foreign import CAR, PLUGINS
from tests.llm.foreign import ROOT

tomllib = pytest.importorskip("tomllib")

FIELDS: dict[str, set[str]] = {
    "task": {"name", "description", "keywords"},
    "agent": {"timeout_sec"},
    "verifier": {"timeout_sec", "environment_mode"},
    "environment": {"build_timeout_sec", "cpus", "memory_mb", "mcp_servers"},
}
"""Keys of the format, by section; `metadata` may hold anything."""

SET = """
title: Short throws
benchmark: {version: 2, pars: {short-throw: {floor: 10, par: 50}}}
axes:
  part:
    first: {workflow: single}
    refined: {workflow: iterative}
  task:
    short-throw: {task: throwing, blocks.max: 20}
table: {metrics: [share]}
"""


def run_script(script: Path, app: Path, logs: Path) -> subprocess.CompletedProcess[str]:
    """Run a script as a container would, with its two folders elsewhere."""
    app.mkdir(exist_ok=True)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.defpath}"
    python = f"{ROOT}{os.pathsep}{PLUGINS}"
    variables = {"PATH": path, "PYTHONPATH": python, "APP": str(app), "LOGS": str(logs)}
    return subprocess.run(
        ["sh", str(script)], env=variables, capture_output=True, text=True, check=False
    )


def read_reward(logs: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((logs / "reward.json").read_text())
    assert float((logs / "reward.txt").read_text()) == found["reward"]
    return found


def test_files_have_the_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wheel = tmp_path / "agentflow_machines-0-py3-none-any.whl"
    wheel.write_bytes(b"")
    options = ["--tasks", "throwing,bridge/2", "--out", str(tmp_path), "--wheel", str(wheel)]
    assert main(["export", "harbor", *options, "--json"]) == 0
    folders = [tmp_path / "throwing-1", tmp_path / "bridge-2"]
    assert json.loads(capsys.readouterr().out) == {"folders": list(map(str, folders))}
    for folder, task in zip(folders, ("throwing", "bridge/2"), strict=True):
        settings = tomllib.loads((folder / "task.toml").read_text())
        assert settings.keys() == {*FIELDS, "schema_version", "artifacts", "metadata"}
        assert {name: settings[name].keys() for name in FIELDS} == FIELDS
        assert settings["task"]["name"] == f"agentflow/{folder.name}"
        assert settings["artifacts"] == ["/app/machine.json"]  # all that the verifier sees
        assert settings["verifier"]["environment_mode"] == "separate"
        [server] = settings["environment"]["mcp_servers"]
        assert (server["transport"], server["command"]) == ("stdio", "agentflow")
        assert server["args"][:3] == ["mcp", "--task", task]
        image = (folder / "environment" / "Dockerfile").read_text()
        assert f"COPY {wheel.name} /tmp/\n" in image
        assert (folder / "environment" / wheel.name).exists()
        told = (folder / "instruction.md").read_text()
        assert f"agentflow bench start --task {task}`" in told
        assert "# Machine format" in told
        assert not (folder / "solution").exists()


def test_items_of_a_benchmark_keep_their_knobs_and_shares(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "set.yaml"
    source.write_text(SET)
    assert main(["export", "harbor", "--set", str(source), "--out", str(tmp_path)]) == 0
    task = tmp_path / "short-throw"
    assert capsys.readouterr().out == f"{task}\n"
    settings = tomllib.loads((task / "task.toml").read_text())
    [server] = settings["environment"]["mcp_servers"]
    assert server["args"][3:5] == ["--set", "blocks.max=20"]
    told = (task / "instruction.md").read_text()
    assert "agentflow bench start --task throwing --set blocks.max=20`" in told
    assert "at most 20 blocks" in told
    graded = json.loads((task / "tests" / "graded.json").read_text())
    assert (graded["floor"], graded["full"], graded["most"]) == (10, 50, 1.5)
    nothing = grade(task / "tests" / "graded.json", tmp_path / "none", tmp_path / "logs")
    assert nothing["full_share"] == 0.0
    assert main(["export", "harbor", "--set", "inspector", "--out", str(tmp_path)]) == 2
    assert "is not a benchmark" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.pybullet
def test_solutions_reach_the_record_and_nothing_else_is_graded(tmp_path: Path) -> None:
    export(items_of(["throwing"]), tmp_path, solutions=True)
    task, app, logs = tmp_path / "throwing-1", tmp_path / "app", tmp_path / "logs"
    test = task / "tests" / "test.sh"
    nothing = {"full_share": 0.0, "valid": 0.0, "reward": 0.0}
    assert grade(test.with_name("graded.json"), app / "machine.json", logs) == nothing
    assert read_reward(logs) == nothing

    assert run_script(task / "solution" / "solve.sh", app, logs).returncode == 0
    found = []
    for _ in range(2):
        assert run_script(test, app, logs).returncode == 0
        found.append(read_reward(logs))
    first, again = found
    assert first == again
    same = agentflow.reward("throwing", (app / "machine.json").read_text())
    assert (first["reward"], first["full_share"]) == (same.value, 1.0)
    assert first["distance"] == same.rollout.terms["distance"]


@pytest.mark.slow
def test_a_crash_is_no_reward(tmp_path: Path) -> None:
    export(items_of(["movement"]), tmp_path)
    task, app, logs = tmp_path / "movement-1", tmp_path / "app", tmp_path / "logs"
    graded = task / "tests" / "graded.json"
    graded.write_text(json.dumps({**json.loads(graded.read_text()), "task": "faulty/2"}))
    app.mkdir()
    (app / "machine.json").write_text(CAR)
    done = run_script(task / "tests" / "test.sh", app, logs)
    assert done.returncode == 1
    assert done.stderr.startswith("agentflow: no reward: faulty/2: No score: the simulation")
    assert not logs.exists()


@pytest.mark.parametrize(
    ("task", "told"),
    [("walking", "unknown task 'walking'"), ("mine.yaml", "cannot read the level mine.yaml")],
)
def test_what_is_not_a_level_is_refused(tmp_path: Path, task: str, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        export(items_of([task]), tmp_path)
    assert not [*tmp_path.iterdir()]


def test_no_tasks_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "harbor", "--tasks", " , ", "--out", str(tmp_path / "out")]) == 2
    assert "name tasks with --tasks" in capsys.readouterr().err


def test_solutions_need_the_repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agentflow.env.tasks.records.MACHINES", tmp_path)
    with pytest.raises(UsageError, match="not in the package but in its repository"):
        export(items_of(["throwing"]), tmp_path / "out", solutions=True)
    assert not (tmp_path / "out").exists()
