"""Every example runs as it stands, and does what it says."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest

from tests.processes import MAIN, run_python

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(*command: str, cwd: Path, path: Path | None = None) -> str:
    """Standard output of a command that ends well and complains of nothing."""
    done = run_python(*command, cwd=cwd, **({"PYTHONPATH": str(path)} if path else {}))
    assert done.stderr == ""
    return done.stdout


def test_every_example_is_listed() -> None:
    listed = set(re.findall(r"\]\(([^)]+)\)", (EXAMPLES / "README.md").read_text()))
    present = {path.name for path in EXAMPLES.iterdir()} - {"README.md"}
    assert listed == present


@pytest.mark.slow
def test_scoring_a_machine(tmp_path: Path) -> None:
    lines = run("-W", "error", str(EXAMPLES / "score_a_machine.py"), cwd=tmp_path).splitlines()
    assert lines[0] == "valid: True"
    assert re.match(r"drives 4\d\.\d m; the digest is always [0-9a-f]{32}$", lines[1])
    assert lines[2] == "with power off 0.0 m"
    assert re.match(r"reward 4\d\.\d, parsed True, valid True", lines[4])
    assert lines[5] == "reward 0.0, parsed False, valid False not_json"
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_a_model_of_ones_own(tmp_path: Path) -> None:
    lines = run("-W", "error", str(EXAMPLES / "own_model.py"), cwd=tmp_path).splitlines()
    first = min(lines[:2])  # both are asked at the same time
    assert re.match(r"designer/traj-1/attempt-1: a prompt of \d{4} characters", first)
    assert re.match(r"always the same car: 4\d\.\d m with 7 blocks", lines[2])
    assert "calls.jsonl events.jsonl machines result.json" in lines[3]
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_a_task_family_outside_the_package(tmp_path: Path) -> None:
    """Installed as far as that is possible without building a wheel: its entry point is found."""
    project = shutil.copytree(EXAMPLES / "pushing", tmp_path / "pushing")
    run(
        "-W", "ignore", "-c", "import setuptools; setuptools.setup()", "-q", "egg_info", cwd=project
    )
    ours = ("-W", "error", "-c", MAIN)
    told = run(*ours, "tasks", "pushing/2", cwd=tmp_path, path=project)
    assert told.startswith("pushing/2 (Push a heavy crate along z+): Build a machine that pushes ")
    assert "A crate of 10 kg" in told
    car = str(EXAMPLES / "car.json")
    told = run(*ours, "simulate", car, "--task", "pushing", cwd=tmp_path, path=project)
    assert re.match(r"ok, score 1\d\.\d\d, 7 of 40 blocks, \S+ \S+\nScore: ", told)
    few = ("--set", "trajectories=1", "--set", "max_simulations=1", "--quiet", "--out", "runs")
    options = ("design", "--task", "pushing", "--workflow", "random-dsl", *few)
    assert "(pushing), " in run(*ours, *options, cwd=tmp_path, path=project)
    few = ("--set", "trajectories=1", "--set", "search.rounds=0", "--quiet", "--out", "planned")
    run(*ours, "design", "--task", "pushing", *few, cwd=tmp_path, path=project)
    (events,) = tmp_path.glob("planned/*/events.jsonl")
    assert '"definition": "ram car: ' in events.read_text()
