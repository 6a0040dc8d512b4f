"""Runs, sweeps, evaluations, training runs and scorecards as objects."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from types import MappingProxyType

import pytest

import agentflow
from agentflow.errors import ConfigError, RunError, UnknownNameError
from agentflow.machine import Machine
from agentflow.notebook.machine_rows import COLUMNS
from agentflow.runs import read_events
from agentflow.runs.record import RunRecord

ROOT = Path(__file__).parents[2]
RECORDED = ROOT / "runs" / "recorded-throwing"
FOUND = json.loads((RECORDED / "result.json").read_text())


def test_a_run_holds_what_its_files_hold() -> None:
    run = agentflow.load(str(RECORDED))
    assert isinstance(run, agentflow.Run)
    assert run == agentflow.Run(RECORDED)
    assert run.state == "done"
    assert run.config.workflow == FOUND["workflow"]
    assert (run.result.score, len(run.calls)) == (FOUND["score"], FOUND["calls"])
    assert isinstance(run.machine, Machine)
    assert run.machine.to_json() == FOUND["machine"]
    assert run.machines[run.machine.digest] == run.machine
    assert run.scores[run.machine.digest] == FOUND["score"]
    assert len(run.machines) == FOUND["rollouts"]
    assert {type(event).__name__ for event in run.events} >= {"AttemptEvent", "EvaluationEvent"}
    assert repr(run) == f"Run({str(RECORDED)!r}, done)"


def test_a_frame_has_a_row_for_each_machine() -> None:
    found = agentflow.Run(RECORDED).to_frame()
    assert list(found) == list(COLUMNS)
    assert len(found) == FOUND["rollouts"]
    best = found[found.score == found.score.max()].iloc[0]
    assert (best.run, best.seed) == ("recorded-throwing", 0)
    assert best.score == FOUND["score"]
    assert best.verified == FOUND["verified"]["score"]
    assert best.stage == FOUND["best_stage"]
    assert best.node.startswith(f"{best.stage}/traj-{best.trajectory}/")
    assert best["round"] == 1
    assert best.parent in set(found.node)
    assert set(found.validity) == {"valid"}
    assert sorted(found.simulations) == list(range(1, FOUND["rollouts"] + 1))
    assert found.calls.iloc[-1] == FOUND["calls"]
    other = agentflow.Run(ROOT / "runs" / "language-model-throwing").to_frame()
    for numbers in ("score", "verified", "tokens"):
        assert other[numbers].dtype.kind in "fi", numbers


def test_curves_rise_with_what_is_spent() -> None:
    run = agentflow.Run(RECORDED)
    for by, last in (
        ("simulations", FOUND["rollouts"]),
        ("calls", FOUND["calls"]),
        ("tokens", FOUND["tokens"]),
    ):
        points = run.curve(by)  # type: ignore[arg-type]
        assert points[-1] == (last, FOUND["score"])
        assert [*points] == sorted(points)
    assert run.curve() == run.curve("simulations")
    assert 0 < run.curve("seconds")[0].spent < run.curve("seconds")[-1].spent
    with pytest.raises(UnknownNameError, match="unknown cost 'token'; known: tokens"):
        run.curve("token")  # type: ignore[arg-type]


def test_a_run_that_grows_gives_what_it_holds(tmp_path: Path) -> None:
    copy = shutil.copytree(RECORDED, tmp_path / "run")
    (copy / "result.json").unlink()
    lines = (copy / "events.jsonl").read_bytes().splitlines(keepends=True)
    (copy / "events.jsonl").write_bytes(b"".join(lines[:40]) + lines[40][:20])
    run = agentflow.Run(copy)
    assert run.state == "stopped"
    assert 0 < len(run.to_frame()) < FOUND["rollouts"]
    with pytest.raises(RunError, match=r"has no result.json: the run is unfinished"):
        _ = run.result
    (copy / "events.jsonl").write_bytes(b"".join(lines))
    assert len(run.events) == 40
    assert len(agentflow.Run(copy).events) == len(lines)


def test_refused_machines_have_rows_too(tmp_path: Path) -> None:
    copy = shutil.copytree(RECORDED, tmp_path / "run")
    text = (copy / "events.jsonl").read_text()
    line = json.loads(next(x for x in text.splitlines() if '"expand"' in x))
    line["data"]["attempts"][0] |= {"valid": False, "note": "an overlap"}
    lines = [
        x
        for x in text.splitlines()
        if '"expand"' not in x or json.loads(x)["label"] != line["label"]
    ]
    (copy / "events.jsonl").write_text("\n".join([*lines, json.dumps(line)]) + "\n")
    rows = agentflow.Run(copy).rows()
    refused = next(row for row in rows if row["validity"] == "refused")
    assert (refused["machine"], refused["score"]) == (None, None)
    assert refused["problem"] == "an overlap"
    labels = [event.label for event in agentflow.Run(copy).events if event.kind == "attempt"]
    asked = next(label for label in labels if "try-1" in label)
    assert refused["calls"] == labels.index(asked) + 1


def test_other_paths_are_refused_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "note.txt").write_text("hello")
    shutil.copytree(RECORDED, tmp_path / "parent" / "run")
    edited = shutil.copytree(RECORDED, tmp_path / "edited") / "run.yaml"
    edited.write_text(edited.read_text().replace("seed: 0", "seed: 1"))
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep" / "sweep.yaml").write_text("[")
    for name, message in {
        "none": "no such file or directory: .*/none",
        "empty": "is not a run, sweep, evaluation or training run: choose a directory",
        "parent": r"but contains runs: use agentflow\.load_runs",
        "note.txt": r"note\.txt is not a scorecard",
        "edited": r"run\.yaml was edited after the run began",
        "sweep": r"sweep\.yaml",
    }.items():
        with pytest.raises(RunError, match=message) as refused:
            agentflow.load(tmp_path / name)
        assert "\n" not in str(refused.value)


def test_a_damaged_run_says_which_line(tmp_path: Path) -> None:
    copy = shutil.copytree(RECORDED, tmp_path / "run")
    lines = (copy / "events.jsonl").read_text().splitlines()
    (copy / "events.jsonl").write_text("\n".join([lines[0], "{", *lines[1:]]) + "\n")
    with pytest.raises(RunError, match=r"line 2 of .*events.jsonl|events.jsonl.*line 2"):
        _ = agentflow.load(copy).events  # type: ignore[union-attr]


def test_runs_of_a_folder(tmp_path: Path) -> None:
    shipped = ["language-model-throwing", "recorded-throwing"]
    for name in reversed(shipped):
        shutil.copytree(ROOT / "runs" / name, tmp_path / "runs" / name)
    assert [run.path.name for run in agentflow.load_runs(tmp_path / "runs")] == shipped
    (tmp_path / "empty").mkdir()
    with pytest.raises(RunError, match="contains no run"):
        agentflow.load_runs(tmp_path / "empty")
    with pytest.raises(RunError, match="no such directory"):
        agentflow.load_runs(tmp_path / "none")


def test_untyped_events_are_refused() -> None:
    with pytest.raises(TypeError, match="untyped event of the kind 'run' adds up to nothing"):
        RunRecord.of(read_events(RECORDED))


def test_a_scorecard_is_a_row_for_each_item() -> None:
    card = agentflow.load(ROOT / "docs" / "cards" / "procedural.json")
    assert isinstance(card, agentflow.Card)
    found = card.to_frame()
    assert len(found) == len(card.content.items)
    assert found.search.mean() == pytest.approx(card.content.total["search"].mean, abs=1e-5)
    assert repr(card).startswith("Card(")
    assert len(repr(card)) < 200


def test_frames_need_pandas_and_rows_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    run = agentflow.Run(RECORDED)
    assert len(run.rows()) == FOUND["rollouts"]
    with pytest.raises(ConfigError) as refused:
        run.to_frame()
    assert str(refused.value) == (
        "pandas is not installed; install it with: pip install 'agentflow-machines[notebook]'"
    )


def test_labels_do_not_distinguish_runs() -> None:
    run = agentflow.Run(RECORDED, MappingProxyType({"task": "a"}))
    assert run == agentflow.Run(RECORDED)
    assert len({run, agentflow.Run(RECORDED)}) == 1
