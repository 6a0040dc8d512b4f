"""Recorded runs in a list, one by one, and simulated again."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path

import pytest

from agentflow.agents.registry import model_roles
from agentflow.app.design.config import config_json
from agentflow.app.inspect.overview import run_details, run_list
from agentflow.app.subjects.verify import rescore
from agentflow.cli.display.show_runs import show_rescored
from agentflow.config.run import build_config
from agentflow.errors import RunError
from agentflow.holding import with_holding
from agentflow.runs import RunDirectory, read_calls, read_document, read_result
from agentflow.runs.reading import document_text

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
RESULT = (RECORDED / "result.json").read_text()
SETTINGS = {
    "trajectories": 2,
    "search.strategy": "mcts",
    "search.rounds": 1,
    "search.width": 2,
}
"""Those of the recorded run that differ from the defaults."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A finished run, one that was cut off, a damaged one, and what is no run."""
    for name in ("finished", "deep/stopped", "damaged"):
        shutil.copytree(RECORDED, tmp_path / name)
    (tmp_path / "deep" / "stopped" / "result.json").unlink()
    (tmp_path / "damaged" / "result.json").write_text("[")
    (tmp_path / "else").mkdir()
    return tmp_path


def test_the_list_tells_the_state_of_each(folder: Path) -> None:
    damaged, stopped, finished = run_list(folder)
    result = read_result(RECORDED)
    assert finished == {
        "run": str(folder / "finished"),
        "state": "done",
        "task": "throwing",
        "workflow": "hierarchical",
        "model": "procedural (no language model)",
        "seed": 0,
        "engine": read_document(RECORDED)["engine"],
        "score": result.score,
        "verified": with_holding(result.to_json()["verified"]),
        "calls": result.calls,
        "cost": 0.0,
        "settings": SETTINGS,
        "problem": "",
    }
    assert stopped == {
        **finished,
        "run": str(folder / "deep" / "stopped"),
        "state": "stopped",
        "cost": None,
        "verified": None,
    }
    assert damaged["state"] == "damaged"
    assert damaged["problem"] == (
        f"{folder / 'damaged' / 'result.json'} is damaged: expected a JSON object"
    )


@pytest.mark.parametrize(
    ("file", "text", "problem"),
    [
        ("result.json", "{}", "it lacks task, workflow, seed, score, valid, machine, stages, "),
        ("result.json", RESULT.replace('"valid": true', '"valid": 1'), "its valid is '1'"),
        ("run.yaml", "", "expected a mapping with `schema`"),
    ],
)
def test_a_run_without_what_a_run_has_is_damaged(
    folder: Path, file: str, text: str, problem: str
) -> None:
    run = folder / "finished"
    (run / file).write_text(text)
    assert next(run_list(run))["state"] == "damaged"
    with pytest.raises(RunError) as caught:
        run_details(run)
    assert str(caught.value).startswith(f"{run / file} is damaged: {problem}")


def test_a_run_under_way_is_running(folder: Path) -> None:
    held = RunDirectory.resume(folder / "deep" / "stopped")
    states = [item["state"] for item in run_list(folder)]
    held.close()
    assert states == ["damaged", "running", "done"]


def test_no_folder_is_said(tmp_path: Path) -> None:
    with pytest.raises(RunError) as caught:
        list(run_list(tmp_path / "none"))
    assert str(caught.value) == f"no such directory: {tmp_path / 'none'}"


def test_one_run_with_what_it_holds() -> None:
    found, result = run_details(RECORDED), read_result(RECORDED)
    calls = Counter(call["request"]["role"] for call in read_calls(RECORDED))
    assert found["stages"] == result.to_json()["stages"]
    assert (found["blocks"], found["best_stage"]) == (len(result.machine), result.best_stage)
    assert {role: spent["calls"] for role, spent in found["spent"].items()} == {
        "total": result.calls,
        **{role: calls[role] for role in model_roles() if calls[role]},
    }
    assert found["spent"]["total"]["money"] == 0.0
    assert found["failures"]["machines"] == result.rollouts
    assert found["config"] == config_json(build_config(read_document(RECORDED)["config"]))
    assert json.loads(json.dumps(found)) == found


@pytest.mark.slow
def test_rescoring_repeats_every_machine_and_changes_nothing() -> None:
    before = {path: path.stat().st_mtime_ns for path in RECORDED.rglob("*")}
    found = rescore(RECORDED, workers=2)
    assert found["identical"] == len(found["machines"]) == read_result(RECORDED).rollouts
    assert {item["difference"] for item in found["machines"]} == {0.0}
    assert found["constants"]["recorded"] == read_document(RECORDED)["constants"]
    assert {path: path.stat().st_mtime_ns for path in RECORDED.rglob("*")} == before


@pytest.mark.slow
def test_rescoring_finds_another_score(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    lines = (run / "events.jsonl").read_text().splitlines()
    at, event = next((i, json.loads(x)) for i, x in enumerate(lines) if '"evaluation"' in x)
    now = event["data"]["score"]
    event["data"]["score"] = now + 1.5
    (run / "events.jsonl").write_text("\n".join([*lines[:at], json.dumps(event), ""]))
    found = rescore(run)
    (item,) = (item for item in found["machines"] if not item["identical"])
    assert item == {
        "machine": event["data"]["machine"],
        "place": event["label"],
        "recorded": {"status": "ok", "score": now + 1.5},
        "now": {"status": "ok", "score": now},
        "difference": pytest.approx(-1.5),
        "identical": False,
        "note": "",
    }


@pytest.mark.slow
def test_machines_that_break_later_rules_are_shown_and_rescored_with_a_note(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = folder / "finished"
    document = read_document(run)
    document["config"]["knobs"] = {"blocks.max": 10, "window": 1}
    (run / "run.yaml").write_text(document_text(document))
    lines = (run / "events.jsonl").read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if '"evaluation"' in line)
    (run / "events.jsonl").write_text("\n".join([*lines[: first + 1], ""]))
    blocks = len(read_result(run).machine)
    assert run_details(run)["remarks"] == [
        f"the best machine would now be refused: the machine has {blocks} blocks; this task "
        f"allows at most 10: remove at least {blocks - 10}"
    ]
    (found,) = (told := rescore(run))["machines"]
    assert found["now"]["status"] == "ok"
    note = found["note"]
    assert note.startswith("would now be refused: the machine has ")
    show_rescored(told)
    assert f"notice: {found['machine']} {note}\n" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["stage", "evaluation", "attempt", "run"])
def test_an_event_that_is_not_as_it_was_written_is_said(folder: Path, kind: str) -> None:
    run = folder / "deep" / "stopped"
    lines = (run / "events.jsonl").read_text().splitlines()
    events = [json.loads(line) for line in lines]
    for event in events:
        if event["kind"] == kind:
            event["data"] = {}
    (run / "events.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events))
    with pytest.raises(RunError, match=r"events\.jsonl is damaged in line \d+: .*: Field required"):
        run_details(run)
