"""Runs that improve a given machine: recorded, replayed, resumed, and refused with a reason."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.app.design.replay import replay
from agentflow.app.design.run import resume
from agentflow.cli import main
from agentflow.runs import read_document, read_result
from tests.machine.builders import build

CAR = Path(__file__).parents[3] / "examples" / "car.json"
TREE = json.loads(CAR.read_text())
DESIGN = ["design", "--task", "movement", "--set", "window=1", "--quiet", "--json"]
SMALL = ["--set", "trajectories=2", "--set", "search.rounds=1", "--set", "search.width=1"]


def ignore(_line: str) -> None:
    """Ignores remarks."""


@pytest.mark.slow
@pytest.mark.parametrize("workflow", ["hierarchical", "single", "random-dsl"])
def test_a_start_machine_is_recorded_and_improved(
    workflow: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "car.bsg"
    assert main(["convert", str(CAR), str(source)]) == 0
    capsys.readouterr()
    options = ["--workflow", workflow, *SMALL, "--start", str(source), "--out", str(tmp_path)]
    assert main([*DESIGN, *options]) == 0
    result = json.loads(capsys.readouterr().out)
    run = Path(result["run"])
    source.unlink()
    assert read_document(run)["config"]["settings"]["start"] == TREE
    assert main(["simulate", str(CAR), *DESIGN[1:5], "--json"]) == 0
    score = json.loads(capsys.readouterr().out)["score"]
    assert result["stages"][0]["max"] == score
    assert result["score"] >= score
    assert replay(run, ignore) is None
    assert main(["show", str(run)]) == 0
    assert "started from a machine with 7 blocks" in capsys.readouterr().out
    other = shutil.copytree(run, tmp_path / "stopped")
    (other / "result.json").unlink()
    lines = (other / "events.jsonl").read_text().splitlines(keepends=True)
    (other / "events.jsonl").write_text("".join(lines[: len(lines) // 2]))
    assert resume(other).machine == read_result(run).machine


INVALID = {
    "no.json": ("[{}]", "no.json: block 0 has no 'type'"),
    "overlap.json": (
        build((15, 0, 0), (15, 0, 0)).to_text(),
        "the start machine is not valid for movement: blocks 1, 2 share face 0 of block 0",
    ),
    "gone.json": (None, "cannot read gone.json: No such file or directory"),
}


@pytest.mark.parametrize("name", INVALID)
def test_an_invalid_start_machine_is_refused(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    text, message = INVALID[name]
    if text is not None:
        Path(name).write_text(text)
    assert main([*DESIGN, "--start", name]) == 2
    assert capsys.readouterr().err.startswith(f"agentflow: {message}")
    assert not Path("runs").exists()


def test_a_start_machine_must_meet_the_task(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "--task", "throwing", "--start", str(CAR)]) == 2
    assert capsys.readouterr().err.startswith(
        "agentflow: the start machine is not valid for throwing: "
    )
