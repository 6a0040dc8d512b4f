"""`agentflow robustness` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.cli import main

CAR = str(Path(__file__).parents[2] / "examples" / "car.json")


def ask(*arguments: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["robustness", *arguments, "--task", "movement"]) == 0
    return capsys.readouterr().out


@pytest.mark.slow
def test_json_holds_both_distributions(capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(ask(CAR, "--n", "4", "--json", capsys=capsys))
    assert (found["world"]["count"], found["edits"]["count"]) == (10, 4)
    assert found["robust"] == found["world"]["quantiles"]["10 %"] <= found["score"]
    assert [item["variation"] for item in found["conditions"]][:2] == ["default", "2 x step rate"]
    assert found["faces"] == sorted(found["faces"], key=lambda item: item["mean"])


@pytest.mark.slow
def test_text_without_neighbours_shows_the_conditions(capsys: pytest.CaptureFixture[str]) -> None:
    out = ask(CAR, "--n", "0", capsys=capsys)
    assert "robust score 45." in out
    assert "0 neighbours, one edit away" in out
    assert "strength -10 %" in out


def test_an_invalid_machine_is_not_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.json").write_text(
        '[{"type": 0, "id": 0, "parent": -1, "face_id": -1},'
        ' {"type": 1, "id": 1, "parent": 0, "face_id": 0},'
        ' {"type": 1, "id": 2, "parent": 0, "face_id": 0}]'
    )
    out = ask(str(tmp_path / "bad.json"), capsys=capsys)
    assert out.startswith("invalid; not simulated\n")
    found = json.loads(ask(str(tmp_path / "bad.json"), "--json", capsys=capsys))
    assert found["problems"][0]["code"]
    assert found["robust"] is None
