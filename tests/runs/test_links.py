"""A run with links is refused before anything outside it is read or written."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from agentflow.cli import main

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"
OUTSIDE = "a file of the user\n"


def unfinished(run: Path) -> None:
    (run / "result.json").unlink()


def linked(name: str, target: str) -> Callable[[Path], None]:
    """Replace a file or folder of a run by a link."""

    def change(run: Path) -> None:
        if (run / name).is_dir():
            shutil.rmtree(run / name)
        (run / name).unlink(missing_ok=True)
        (run / name).symlink_to(run.parent / target)

    return change


COMMANDS: dict[str, tuple[list[str], Callable[[Path], None]]] = {
    "report.html": (["report"], linked("report.html", "own.txt")),
    "report.html of no target": (["report"], linked("report.html", "new.txt")),
    "best.png": (["render"], linked("best.png", "own.txt")),
    "machines in a report": (["report"], linked("machines", "own")),
    "machines": (["design", "--resume"], linked("machines", "own")),
    "rollouts": (["design", "--resume"], linked("rollouts", "own")),
    "events.jsonl": (["design", "--resume"], linked("events.jsonl", "own.txt")),
    "calls.jsonl": (["design", "--resume"], linked("calls.jsonl", "own.txt")),
    "result.json as a machine": (["check"], linked("result.json", "own.txt")),
    "result.json": (["show"], linked("result.json", "own.txt")),
    "run.yaml": (["show"], linked("run.yaml", "own.txt")),
    "calls.jsonl of failures": (["failures"], linked("calls.jsonl", "own.txt")),
    "events.jsonl of a replay": (["replay"], linked("events.jsonl", "own.txt")),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_links_are_refused_and_nothing_outside_changes(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, change = COMMANDS[name]
    (tmp_path / "own.txt").write_text(OUTSIDE)
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / ".1-kept").write_text(OUTSIDE)
    run = shutil.copytree(RECORDED, tmp_path / "run")
    if "--resume" in command:
        unfinished(run)
    change(run)
    before = sorted(os.listdir(tmp_path)), sorted(os.listdir(tmp_path / "own"))
    assert main([*command, str(run)]) == 2
    place = run / name.partition(" ")[0]
    assert capsys.readouterr().err == (
        f"agentflow: {place} is a link, but runs and sweeps hold only files and directories; "
        "remove it\n"
    )
    assert (tmp_path / "own.txt").read_text() == OUTSIDE
    assert (sorted(os.listdir(tmp_path)), sorted(os.listdir(tmp_path / "own"))) == before


def test_a_pipe_in_a_run_does_not_stop_its_reader(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    (run / "calls.jsonl").unlink()
    os.mkfifo(run / "calls.jsonl")
    assert main(["failures", str(run)]) == 2
    assert f"{run / 'calls.jsonl'} is a pipe or device" in capsys.readouterr().err


def test_calls_that_a_finished_run_has_lost_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    (run / "calls.jsonl").unlink()
    assert main(["show", str(run)]) == 2
    assert f"{run / 'calls.jsonl'} is missing; restore it from a copy" in capsys.readouterr().err


def test_links_in_a_sweep_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own").mkdir()
    sweep = tmp_path / "sweep"
    sweep.mkdir()
    (sweep / "sweep.yaml").write_text("schema: 1\n")
    (sweep / "runs").symlink_to(tmp_path / "own")
    for command in (["table", str(sweep)], ["sweep", str(sweep), "--resume"]):
        assert main(command) == 2
        assert f"{sweep / 'runs'} is a link" in capsys.readouterr().err
