"""Commands with --backend ray: the same results and files, also after the driver was killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

pytest.importorskip("ray")

from agentflow.app.design.replay import replay
from agentflow.cli import main
from tests.app.sweeps.test_run import TINY
from tests.cluster.conftest import ON_CLUSTER
from tests.training.data.conftest import OBJECTIVES
from tests.training.data.test_generate import generate

Captured = pytest.CaptureFixture[str]
pytestmark = ON_CLUSTER
SMALL = (
    *("design", "--task", "movement", "--set", "window=1", "--set", "trajectories=2"),
    *("--rollouts", "8", "--set", "verify=false", "--quiet", "--json"),
)
DESIGN = (*SMALL, "--workflow", "random-dsl")
MAIN = "import sys; from agentflow.cli import main; sys.exit(main())"
IMPATIENT = "connection.watch.__defaults__ = (0.5, 3.0)"
"""Code that lets a command notice sooner that Ray is gone."""


def test_the_kinds_that_are_explored_are_those_found_here(tmp_path: Path, capsys: Captured) -> None:
    pytest.importorskip("ribs")
    command = [*SMALL, "--workflow", "explore", "--backend", "ray", "--out", str(tmp_path)]
    assert main(command) == 0
    assert replay(Path(json.loads(capsys.readouterr().out)["run"]), print) is None


def test_a_driver_that_is_killed_is_resumed(tmp_path: Path, capsys: Captured) -> None:
    command = [sys.executable, "-c", MAIN, *DESIGN, "--backend", "ray", "--out", str(tmp_path)]
    kill_once_evaluated(command, tmp_path)
    (run,) = tmp_path.iterdir()
    assert main(["design", "--resume", str(run), "--backend", "ray", "--quiet", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["valid"]  # nothing but JSON on standard output
    assert replay(run, print) is None


def kill_once_evaluated(command: list[str], out: Path) -> None:
    """Start a command, and kill it when a machine has been evaluated."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as driver:
        wait_until_evaluated(driver, out)
        driver.kill()


def wait_until_evaluated(driver: subprocess.Popen[bytes], out: Path) -> None:
    """Wait until a command has evaluated a machine."""
    while not any('"evaluation"' in log.read_text() for log in out.glob("**/events.jsonl")):
        assert driver.poll() is None
        time.sleep(0.05)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_command_whose_raylet_is_killed_ends_and_says_how_to_continue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("RAY_ADDRESS")  # so that the command starts a cluster of its own
    command = ["design", "--task", "movement", "--rollouts", "500", "--out", str(tmp_path)]
    code = f"from agentflow.cluster import connection; {IMPATIENT}; {MAIN}"
    with subprocess.Popen(
        [sys.executable, "-c", code, *command, "--backend", "ray"], stderr=subprocess.PIPE
    ) as driver:
        wait_until_evaluated(driver, tmp_path)
        children = Path(f"/proc/{driver.pid}/task/{driver.pid}/children").read_text().split()
        named = {Path(f"/proc/{child}/comm").read_text().strip(): int(child) for child in children}
        os.kill(named["raylet"], signal.SIGKILL)
        _, told = driver.communicate()
    (run,) = tmp_path.iterdir()
    assert driver.returncode == 2
    last = told.decode().splitlines()[-1]
    assert last.startswith("agentflow: Ray no longer answers on this computer")
    assert last.endswith(f"continue with: agentflow design --resume {run}")


def test_a_sweep_whose_driver_is_killed_is_resumed(tmp_path: Path) -> None:
    plan = tmp_path / "tiny.yaml"
    plan.write_text(yaml.safe_dump(TINY))
    command = ["sweep", str(plan), "--backend", "ray", "--out", str(tmp_path), "--quiet"]
    kill_once_evaluated([sys.executable, "-c", MAIN, *command], tmp_path)
    time.sleep(5)  # Ray ends the tasks of a driver that is gone
    assert main([*command, "--resume"]) == 0
    runs = sorted((tmp_path / "tiny" / "runs").iterdir())
    assert [replay(run, print) for run in runs] == [None] * 4


def test_the_runs_of_a_sweep_are_those_that_are_made_here(tmp_path: Path) -> None:
    plan = tmp_path / "tiny.yaml"
    plan.write_text(yaml.safe_dump(TINY))
    shared = ["--store", (tmp_path / "shared").as_uri()]
    command = ["sweep", str(plan), "--backend", "ray", *shared, "--out", str(tmp_path), "--quiet"]
    assert main(command) == 0
    runs = sorted((tmp_path / "tiny" / "runs").iterdir())
    assert len(runs) == 4
    stores = (tmp_path / "shared", tmp_path / "tiny" / "store")
    theirs, own = ({file.name for file in (store / "rollouts").iterdir()} for store in stores)
    assert theirs == own != set()
    assert [replay(run, print) for run in runs] == [None] * 4


def test_an_evaluation_judges_as_here(tmp_path: Path) -> None:
    command = ["evaluate", "procedural", "--task", "movement", "--samples", "6", "--json"]
    for where in ("local", "ray"):
        assert main([*command, "--backend", where, "--out", str(tmp_path / where)]) == 0
    local, ray = ((tmp_path / where / "samples.jsonl").read_bytes() for where in ("local", "ray"))
    assert local == ray


def test_data_are_filtered_as_here(tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    objectives, answers = tmp_path / "objectives.yaml", str(tmp_path / "answers")
    objectives.write_text(OBJECTIVES, encoding="utf-8")
    assert main(generate(objectives, Path(answers))) == 0
    for where in ("local", "ray"):
        out = ["--out", str(tmp_path / where), "--quiet"]
        assert main(["data", "filter", answers, "--backend", where, *out]) == 0
    sets = [
        [(tmp_path / where / file).read_bytes() for file in ("train.jsonl", "dev.jsonl")]
        for where in ("local", "ray")
    ]
    assert sets[0] == sets[1]
    assert any(sets[0])


def test_many_machines_are_simulated_as_here(tmp_path: Path, capsys: Captured) -> None:
    car = json.dumps(json.loads(Path("examples/car.json").read_text()))
    machines = tmp_path / "machines.jsonl"
    machines.write_text("\n".join([car, "[]", car, car]) + "\n")
    command = ["simulate", str(machines), "--jsonl", "--task", "movement", "--set", "window=1"]
    found = {}
    for where in ("local", "ray"):
        assert main([*command, "--backend", where]) == 0
        lines = map(json.loads, capsys.readouterr().out.splitlines())
        found[where] = [(line["status"], line["score"], line.get("digest")) for line in lines]
    assert found["local"] == found["ray"]
    assert [status for status, _, _ in found["ray"]] == ["ok", "invalid", "ok", "ok"]
