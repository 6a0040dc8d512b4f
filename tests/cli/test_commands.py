"""The commands as a user types them: what they print, and how they end."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from agentflow.cli import main
from tests.env.test_rollout import KEYS

Captured = pytest.CaptureFixture[str]

CAR = [
    {"type": 0, "id": 0, "parent": -1, "face_id": -1},
    {"type": 1, "id": 1, "parent": 0, "face_id": 0},
    {"type": 1, "id": 2, "parent": 0, "face_id": 1},
    {"type": 2, "id": 3, "parent": 1, "face_id": 1},
    {"type": 2, "id": 4, "parent": 1, "face_id": 3},
    {"type": 2, "id": 5, "parent": 2, "face_id": 1},
    {"type": 2, "id": 6, "parent": 2, "face_id": 3},
]


@pytest.fixture
def car(tmp_path: Path) -> str:
    path = tmp_path / "car.json"
    path.write_text(json.dumps(CAR))
    return str(path)


def test_check_reports_exactly_the_documented_keys(car: str, capsys: Captured) -> None:
    assert main(["check", car, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report == {
        "file_valid": True,
        "spatial_valid": True,
        "machine_valid": True,
        "repaired": False,
        "problems": [],
        "overlaps": [],
        "size": [2.0, 2.0, 5.0],
        "warnings": [],
    }


def test_check_lists_positions_on_request(car: str, capsys: Captured) -> None:
    assert main(["check", car, "--geometry", "--json"]) == 0
    wheel = json.loads(capsys.readouterr().out)["blocks"][3]
    assert wheel["position"] == [-0.5, 0.0, 1.0]
    assert wheel["orientation"] == "x-"
    assert wheel["faces"] == [{"face_id": 0, "position": [-1.0, 0.0, 1.0], "facing": "x-"}]


def test_check_lines_gives_one_report_per_line(tmp_path: Path, capsys: Captured) -> None:
    lines = [json.dumps(CAR), "no json at all", json.dumps("```json\n[{}]\n```"), "{}"]
    (tmp_path / "many.jsonl").write_text("\n".join(lines) + "\n")
    assert main(["check", str(tmp_path / "many.jsonl"), "--jsonl"]) == 0
    reports = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [report["file_valid"] for report in reports] == [True, False, False, False]
    assert [report["problems"][0]["code"] for report in reports[1:]] == [
        "not_json",
        "missing_field",
        "not_a_list",
    ]


@pytest.mark.slow
def test_a_run_is_simulated_on_its_own_task(car: str, capsys: Captured) -> None:
    run = Path(__file__).parents[2] / "runs" / "recorded-throwing"
    assert main(["simulate", str(run), "--json"]) == 0
    recorded = json.loads((run / "result.json").read_text())
    found = json.loads(capsys.readouterr().out)
    assert found["score"] == pytest.approx(recorded["score"], abs=0.5)
    assert main(["simulate", car]) == 2
    assert "a machine file does not name its task; add --task" in capsys.readouterr().err
    assert main(["simulate", car, "--jsonl"]) == 2
    assert "--jsonl reads machines only; name their task" in capsys.readouterr().err


def test_simulate_gives_exactly_the_documented_keys(car: str, capsys: Captured) -> None:
    assert main(["simulate", car, "--task", "movement", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert list(result) == [*KEYS, "blocks", "most_blocks"]
    assert result["status"] == "ok"
    assert 40 <= result["score"] <= 50


def test_simulate_without_power_earns_nothing(car: str, capsys: Captured) -> None:
    assert main(["simulate", car, "--task", "movement", "--power", "off", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["score"] == pytest.approx(0, abs=0.01)


def test_an_invalid_machine_is_a_result(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "bad.json").write_text(json.dumps([*CAR, {**CAR[1], "id": 7}]))
    assert main(["simulate", str(tmp_path / "bad.json"), "--task", "movement", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["status"], result["score"]) == ("invalid", 0)
    assert {problem["code"] for problem in result["problems"]} == {"face_occupied", "overlap"}


@pytest.mark.parametrize("ending", [".coords.json", ".bsg"])
def test_simulate_takes_every_form(car: str, ending: str, tmp_path: Path, capsys: Captured) -> None:
    other = str(tmp_path / f"car{ending}")
    assert main(["convert", car, other]) == 0
    capsys.readouterr()
    scores = []
    for source in (car, other):
        assert main(["simulate", source, "--task", "movement", "--json"]) == 0
        scores.append(json.loads(capsys.readouterr().out)["score"])
    assert scores[0] == scores[1]


@pytest.mark.parametrize("rate", ["0", "-5", "nan", "1e12"])
def test_a_rate_out_of_range_is_refused(car: str, rate: str, capsys: Captured) -> None:
    assert main(["simulate", car, "--task", "movement", "--rate", rate]) == 2
    assert "it must be from 30 to 1000 Hz" in capsys.readouterr().err


@pytest.mark.slow
def test_simulate_lines_gives_one_result_per_line_in_order(
    tmp_path: Path, capsys: Captured
) -> None:
    short = [*CAR[:1], {"type": 63, "id": 1, "parent": 0, "face_id": 0}]
    lines = [json.dumps(machine) for machine in (CAR, short, CAR)]
    (tmp_path / "many.jsonl").write_text("\n".join([*lines, "nonsense"]) + "\n")
    source = str(tmp_path / "many.jsonl")
    assert main(["simulate", source, "--jsonl", "--task", "movement", "--workers", "2"]) == 0
    first, second, third, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert first["digest"] == third["digest"]
    assert (first["status"], second["status"], last["status"]) == ("ok", "ok", "invalid")
    assert second["score"] < 0.01 < 40 < first["score"]


QUERY = json.dumps({"id": 0, "duration": [0, 0.4], "properties": ["position"]})


@pytest.mark.parametrize(
    ("interval", "times"),
    [
        ([], [0.0, 0.2, 0.4]),
        (["--interval", "0.1"], [0.0, 0.1, 0.2, 0.3, 0.4]),
        (["--interval", "0.3"], [0.0, 0.3]),
    ],
)
def test_simulate_answers_queries(
    car: str, interval: list[str], times: list[float], capsys: Captured
) -> None:
    arguments = ["simulate", car, "--task", "movement", "--query", QUERY, "--json"]
    assert main([*arguments, *interval]) == 0
    (answer,) = json.loads(capsys.readouterr().out)["answers"]
    assert answer["times"] == pytest.approx(times)


@pytest.mark.slow
def test_simulate_answers_queries_on_every_line(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "many.jsonl").write_text(f"{json.dumps(CAR)}\nnonsense\n")
    arguments = ["simulate", str(tmp_path / "many.jsonl"), "--jsonl", "--task", "movement"]
    assert main([*arguments, "--query", QUERY, "--interval", "0.4"]) == 0
    first, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert first["answers"][0]["times"] == pytest.approx([0.0, 0.4])
    assert last["status"] == "invalid"
    assert (last["terms"], last["broken"], last["events"]) == ({}, [], [])


@pytest.mark.parametrize("interval", ["0", "-1", "nan"])
def test_simulate_rejects_an_interval_that_is_not_above_zero(
    car: str, interval: str, capsys: Captured
) -> None:
    assert main(["simulate", car, "--task", "movement", f"--interval={interval}"]) == 2
    assert "it must be above 0 s" in capsys.readouterr().err


def test_blocks_and_tasks_are_data_too(capsys: Captured) -> None:
    assert main(["blocks", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)) == 37
    assert main(["blocks", "log", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["type"] == 63
    assert main(["tasks", "--json"]) == 0
    names = [task["name"] for task in json.loads(capsys.readouterr().out)]
    assert {"throwing", "movement"} <= set(names)
    assert main(["tasks", "throwing", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["required"] == {"36": 1}


WRONG = [
    (["design", "--task", "thowing"], 2, "unknown task 'thowing'; known: throwing, "),
    (["design", "--workflow", "hirarchical"], 2, "unknown workflow 'hirarchical'; known: hier"),
    (["design", "--set", "wall.hight=2"], 2, "unknown knob 'wall.hight' of throwing; known: "),
    (["design", "--set", "wall.height=99"], 2, "wall.height of throwing must be 0 to 10 m, not 99"),
    (["design", "--set", "search.rounds=-1"], 2, "settings.search.rounds: must be at least 0"),
    (["design", "--set", "prompts=nice"], 2, "unknown prompt set 'nice'; known: "),
    (["design", "--config", "none.yaml"], 2, "cannot read none.yaml: No such file or directory"),
    (["design", "--resume", "none"], 2, "none is not a run directory: it has no readable run.yaml"),
    (["design", "--model", "m", "--base-url", "nowhere"], 2, "the base URL must look like "),
    (["replay", "none"], 2, "none is not a run directory: it has no readable run.yaml"),
    (["check", "none.json"], 2, "cannot read none.json: No such file or directory"),
    (["simulate", "none.json", "--task", "x"], 2, "unknown task 'x'; known: "),
    (
        ["simulate", "words", "--task", "movement"],
        2,
        "words contains no machine: no JSON list found",
    ),
    (["check", "words"], 2, "words contains no machine: no JSON list found"),
    (["simulate", "none", "--jsonl", "--task", "movement"], 2, "cannot read none: No such file"),
    (
        ["simulate", "words", "--jsonl", "--task", "movement", "--save", "x.npz"],
        2,
        "--save needs a single machine; remove --jsonl",
    ),
    (["check", "/dev/zero"], 2, "/dev/zero is larger than 64 MB; expected a machine"),
    (["design", "--base-url", ""], 2, "model.base_url: must not be empty"),
    (["design", "--set", "model=5"], 2, "model: expected a group of keys, not 5"),
    (
        ["design", "--set", "search.rounds=2001-99-99"],
        2,
        "--set search.rounds: '2001-99-99' is not",
    ),
    (
        ["design", "--set", "model.sampling.temperature=.nan"],
        2,
        "model.sampling.temperature: expected a finite number, not nan",
    ),
    (["design", "--workers", "100000"], 2, "workers: must be at most 4096, not 100000"),
    (["design", "--resume", "x", "--seed", "1"], 2, "--resume uses the settings of the run"),
    (["check", "words", "--set", "window=5"], 2, "--set changes a knob of a task; name the task"),
    (["tasks", "movement", "--set", "noequals"], 2, "--set takes name=value, not 'noequals'"),
    (["tasks", "x" * 500], 2, f"unknown task '{'x' * 60}...'; known: "),
    (["blocks", "99"], 2, "unknown block type '99'; known: "),
    (["simulate"], 2, "Missing argument"),
    (["desing"], 2, "No such command 'desing'"),
    (["design", "--nonsense"], 2, "No such option: --nonsense"),
]


@pytest.mark.parametrize(("arguments", "status", "message"), WRONG, ids=lambda v: str(v)[:60])
def test_wrong_input_is_one_line_and_leaves_nothing(
    arguments: list[str],
    status: int,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "words").write_text("this is no machine")
    assert main(arguments) == status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"agentflow: {message}")
    assert captured.err.count("\n") == 1
    assert os.listdir(tmp_path) == ["words"]


def test_debug_shows_the_traceback(capsys: Captured) -> None:
    assert main(["tasks", "thowing", "--debug"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("Traceback")
    assert "\nagentflow: unknown task" in told
