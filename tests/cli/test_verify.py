"""`agentflow verify` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.cli import main
from agentflow.env.physics.engines import default_engine, installed_engines
from tests.app.pages.test_runs import RECORDED

CAR = str(Path(__file__).parents[2] / "examples" / "car.json")
Captured = pytest.CaptureFixture[str]


@pytest.mark.slow
def test_a_machine_is_verified_as_text_and_as_json(capsys: Captured) -> None:
    assert main(["verify", CAR, "--task", "movement", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == ["task", "seed", "engine", "score", "verified", "others", "problems"]
    verified = found["verified"]
    assert list(verified) == ["score", "low", "high", "scores", "holds", "fails", "fragile"]
    assert (verified["holds"], verified["fails"], verified["fragile"]) == (8, [], False)
    assert verified["low"] <= verified["score"] <= verified["high"]
    assert [list(item) for item in verified["scores"]] == [["variation", "status", "score"]] * 8
    assert verified["scores"][0]["score"] == found["score"]
    assert main(["verify", CAR, "--task", "movement"]) == 0
    first, second, head, default, *lines = capsys.readouterr().out.splitlines()
    varied, others = lines[:7], lines[7:]
    assert first == f"score {found['score']:.2f} (movement, {default_engine().identity})"
    assert second == (
        f"verified score {verified['score']:.2f}, the median of 8 simulations that scored "
        f"{verified['low']:.2f} to {verified['high']:.2f}; holds in 8 of 8"
    )
    assert head.split() == ["simulation", "score", "change"]
    assert default.split() == ["default", f"{found['score']:.2f}"]
    for line, item in zip(varied, verified["scores"][1:], strict=True):
        change = 100 * (item["score"] / found["score"] - 1)
        assert line.startswith(item["variation"])
        assert line.split()[-3] == f"{item['score']:.2f}"
        assert float(line.split()[-2]) == pytest.approx(change, abs=0.051)
    assert [item["engine"] for item in found["others"]] == [
        str(spec.identity) for spec in installed_engines()[1:]
    ]
    assert others == [
        f"not part of the median: {item['score']:.2f} with {item['engine']}"
        for item in found["others"]
    ]


def test_an_invalid_machine_says_why(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "empty.json").write_text("[]")
    assert main(["verify", str(tmp_path / "empty.json"), "--task", "movement"]) == 0
    first, problem = capsys.readouterr().out.splitlines()
    assert first == "invalid, verified score 0.00"
    assert problem.startswith("empty: ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([CAR], "a machine file does not name its task; add --task"),
        (
            [str(RECORDED), "--seed", "1"],
            "a run has its own task, knobs, seed and engine; remove --set, --seed and --engine, or "
            "name a task with --task",
        ),
    ],
)
def test_what_is_missing_is_named(arguments: list[str], message: str, capsys: Captured) -> None:
    assert main(["verify", *arguments]) == 2
    assert capsys.readouterr() == ("", f"agentflow: {message}\n")


def test_a_directory_must_be_a_run(tmp_path: Path, capsys: Captured) -> None:
    assert main(["verify", str(tmp_path)]) == 2
    told = f"agentflow: {tmp_path} is not a run directory: it has no readable run.yaml\n"
    assert capsys.readouterr() == ("", told)
