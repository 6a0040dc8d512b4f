"""Pages of training runs: what is on them, and what is left out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.pages.training import training_report
from agentflow.cli import main
from agentflow.errors import RunError
from agentflow.training.record import About, TrainingRun
from tests.app.pages.test_runs import data_of, quiet
from tests.training.folders import Config, drives, throws, write_training

Captured = pytest.CaptureFixture[str]

CURVES = [
    {"loss": 0.5, "reward": 1.0, "valid": 0.5, "unheard_of": 3, "faults": 0, "clipped": 0.0},
    {"loss": 0.25, "reward": None, "valid": 0.75, "eval": {"throwing": {"valid": {"share": 0.75}}}},
]


def run_with(path: Path, *, samples: bool = True) -> Path:
    with TrainingRun.open(path, About(kind="grpo", label="m"), Config(), resume=False) as run:
        for step, numbers in enumerate(CURVES, start=1):
            run.note(step, numbers)
        if samples:
            run.samples(1, [*throws(), *drives()])
            run.samples(2, throws()[:1])
    return path


def moves(machine: dict[str, Any]) -> bool:
    """Whether there is a film of it."""
    return bool(machine["film"]["samples"] > 10)


@pytest.mark.slow
def test_curves_samples_and_films_are_on_the_page(tmp_path: Path) -> None:
    path = run_with(tmp_path / "pass1")
    data = data_of(training_report(path, tmp_path / "r.html", films=1, workers=1, say=quiet))
    assert (data["kind"], data["title"], data["label"]) == ("training", "pass1", "m")
    assert data["about"] == "reinforcement learning (GRPO), 2 steps, unfinished"
    charts = {chart["title"]: chart for chart in data["charts"]}
    assert list(charts) == ["Reward", "Replies", "Loss", "Time so far", "unheard_of"]
    assert data["zero"] == ["faults", "clipped"]
    assert charts["Reward"]["lines"] == [{"name": "reward", "points": [[1, 1.0]]}]
    assert charts["Loss"]["lines"] == [{"name": "loss", "points": [[1, 0.5], [2, 0.25]]}]
    throwing, movement = data["tasks"]
    assert (throwing["task"], movement["task"]) == ("throwing", "movement")
    assert movement["charts"] == []
    [chart] = throwing["charts"]
    assert chart["lines"] == [{"name": "valid.share", "points": [[2, 0.75]]}]
    first, drive, last = data["steps"]
    best = max(reply.score or 0.0 for reply in throws())
    assert (first["step"], first["task"], first["valid"], first["count"]) == (1, "throwing", 3, 4)
    assert first["best"][0]["score"] == best
    assert first["values"][-1] == best
    assert [reply["problem"] for reply in first["refused"]] == ["not_json"]
    assert (drive["task"], len(drive["best"]), last["step"]) == ("movement", 1, 2)
    assert len(data["machines"]) == 4
    moving = {key: item for key, item in data["machines"].items() if moves(item)}
    assert list(moving) == [last["best"][0]["machine"]]
    assert moving[last["best"][0]["machine"]]["remark"] == ""  # it scores the same again
    assert data["facts"] == [["tasks", "throwing"], ["seed", "0"]]


@pytest.mark.slow
def test_every_film_is_that_of_the_recorded_score(tmp_path: Path) -> None:
    path = write_training(tmp_path / "run")
    data = data_of(training_report(path, tmp_path / "r.html", films=9, workers=2, say=quiet))
    assert [moves(item) for item in data["machines"].values()] == [True] * 3
    assert {item["remark"] for item in data["machines"].values()} == {""}


def test_supervised_fine_tuning_has_curves_and_no_film(tmp_path: Path) -> None:
    path = run_with(tmp_path / "sft", samples=False)
    data = data_of(training_report(path, tmp_path / "r.html", films=9, workers=1, say=quiet))
    assert (data["machines"], data["steps"], data["tasks"]) == ({}, [], [])
    assert [chart["title"] for chart in data["charts"]][:1] == ["Reward"]


def test_a_folder_of_training_runs_names_one(tmp_path: Path, capsys: Captured) -> None:
    for name in ("best-0", "pass1-0"):
        run_with(tmp_path / name, samples=False)
    assert main(["report", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert f"but holds some: give one of them, such as {tmp_path / 'best-0'};" in told


@pytest.mark.slow
def test_forged_numbers_and_machines_break_nothing(tmp_path: Path) -> None:
    path = run_with(tmp_path / "forged")
    for number in ("NaN", "Infinity", "1e999", str(10**400)):
        (path / "curves.jsonl").write_text(f'{{"step": 1, "loss": {number}}}\n')
        with pytest.raises(RunError, match=r"curves.jsonl is damaged in line 1: .*finite numbers"):
            training_report(path, tmp_path / "r.html", films=0, workers=1, say=quiet)
    (path / "curves.jsonl").write_text('{"step": 1, "valid": 1}\n')
    overlapping = [*(throws()[0].machine or []), (throws()[0].machine or [])[1]]
    forged = throws()[0].model_copy(update={"machine": overlapping, "score": 99.0})
    samples = path / "samples" / "step-000002.jsonl"
    samples.write_text(forged.model_dump_json() + "\n")
    data = data_of(training_report(path, tmp_path / "r.html", films=0, workers=1, say=quiet))
    assert [chart["title"] for chart in data["charts"]] == ["Replies"]
    assert data["steps"][-1]["best"] == []
    samples.write_text(
        json.dumps({**json.loads(forged.model_dump_json()), "score": float("nan")}) + "\n"
    )
    with pytest.raises(RunError, match="line 1 is damaged: score "):
        training_report(path, tmp_path / "r.html", films=9, workers=1, say=quiet)


def test_the_command_knows_a_training_run(tmp_path: Path, capsys: Captured) -> None:
    path = run_with(tmp_path / "run", samples=False)
    assert main(["report", str(path)]) == 0
    assert capsys.readouterr().out == f"{path / 'report.html'}\n"
    (path / "curves.jsonl").write_text("{}\n")
    assert main(["report", str(path)]) == 2
    assert "is not an object with a step and finite numbers" in capsys.readouterr().err
