"""Comparing machines from files and runs: blocks, scores, a page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.machine import Machine
from agentflow.runs import read_document, read_result
from agentflow.runs.reading import document_text
from tests.app.pages.test_runs import data_of
from tests.machine.builders import CAR, build

RECORDED = Path(__file__).parents[3] / "runs" / "recorded-throwing"
SHORT = ["--task", "movement", "--set", "window=1"]
WIDER = build(*((step.type, step.parent, step.face_id) for step in CAR.steps[1:6]), (7, 0, 4, 2, 4))
"""The car with a brace in place of its last wheel."""
Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("car.json").write_text(CAR.to_text())
    Path("wider.json").write_text(WIDER.to_text())


def compared(capsys: Captured, *arguments: str) -> dict[str, object]:
    assert main(["compare", *arguments, "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_blocks_are_compared_without_a_task(capsys: Captured) -> None:
    found = compared(capsys, "car.json", "wider.json")
    assert (found["task"], found["same"]) == (None, 6)
    assert found["types"] == [
        {"type": 2, "name": "Powered Wheel", "counts": [4, 3]},
        {"type": 7, "name": "Brace", "counts": [0, 1]},
    ]
    ((wheel,), (brace,)) = found["only"]  # type: ignore[misc]
    assert wheel == {
        "id": 6,
        "type": 2,
        "name": "Powered Wheel",
        "positions": [[-0.5, 0.0, -1.0]],
        "direction": "x-",
    }
    assert (brace["id"], brace["direction"], len(brace["positions"])) == (6, None, 2)


def test_ids_and_the_order_of_ends_do_not_matter(capsys: Captured) -> None:
    Path("a.json").write_text(build((1, 0, 0), (15, 0, 1), (7, 1, 2, 2, 1)).to_text())
    Path("b.json").write_text(build((15, 0, 1), (1, 0, 0), (7, 1, 1, 2, 2)).to_text())
    found = compared(capsys, "a.json", "b.json")
    assert (found["same"], found["only"], found["types"]) == (4, [[], []], [])


@pytest.mark.slow
def test_scores_are_those_of_simulate(capsys: Captured) -> None:
    Path("lame.json").write_text(Machine(CAR.steps[:-1]).to_text())
    found = compared(capsys, "car.json", "lame.json", *SHORT)
    for name, machine in zip(("car", "lame"), found["machines"], strict=True):  # type: ignore[call-overload]
        assert main(["simulate", f"{name}.json", *SHORT, "--json"]) == 0
        simulated = json.loads(capsys.readouterr().out)
        assert (machine["score"], machine["status"]) == (simulated["score"], "ok")
        assert machine["terms"] == simulated["terms"]
    assert main(["compare", "car.json", "lame.json", *SHORT]) == 0
    told = capsys.readouterr().out
    assert "only in A: block 6 (Powered Wheel) at [-0.5, 0.0, -1.0] facing x-\n" in told
    assert "6 blocks are in both machines\n" in told


@pytest.mark.slow
def test_a_run_brings_its_task_and_a_page_shows_both_films(capsys: Captured) -> None:
    found = compared(capsys, str(RECORDED), "car.json", "--out", "page.html")
    assert (found["task"], found["seed"]) == ("throwing", 0)
    run, car = found["machines"]  # type: ignore[misc]
    assert run["blocks"] == len(read_result(RECORDED).machine)
    assert (run["status"], car["status"], car["score"]) == ("ok", "invalid", 0.0)
    assert car["problems"] == [
        "the task requires exactly 1 block of type 36 (Boulder); there are 0"
    ]
    data = data_of(Path("page.html"))
    assert data["kind"] == "compare"
    assert [film["film"]["samples"] > 1 for film in data["films"]] == [True, False]
    assert data["machines"] == found["machines"]


def test_of_an_unfinished_run_the_best_machine_so_far_is_compared(capsys: Captured) -> None:
    shutil.copytree(RECORDED, "stopped")
    Path("stopped/result.json").unlink()
    found = compared(capsys, "stopped", str(RECORDED), "--set", "window=1", "--task", "throwing")
    assert found["only"] == [[], []]
    assert found["notes"] == ["stopped is unfinished: this is its best machine so far"]
    Path("stopped/events.jsonl").write_text("")
    assert main(["compare", "stopped", "car.json"]) == 2
    assert "no machine of it has a score yet" in capsys.readouterr().err


def test_wrong_comparisons_are_refused(capsys: Captured) -> None:
    shutil.copytree(RECORDED, "other")
    document = read_document(Path("other"))
    document["config"] = {**document["config"], "task": "movement"}
    del document["level"]
    Path("other/run.yaml").write_text(document_text(document))
    wrong = {
        (str(RECORDED), "other"): "the runs are of different tasks (throwing and movement); name",
        ("car.json", "gone.json"): "cannot read gone.json: No such file or directory",
        ("car.json", "car.json", "--out", "x.html"): "the films need a task; name it with --task",
        ("car.json", "car.json", "--set", "window=1"): "--set changes a knob of a task; name the",
        ("car.json", "car.json", *SHORT, "--out", "no/x.html"): "cannot write no/x.html: no such",
    }
    for arguments, message in wrong.items():
        assert main(["compare", *arguments]) == 2
        assert capsys.readouterr().err.startswith(f"agentflow: {message}")
