"""What users met: messages that name what to change, and summaries that explain themselves."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from agentflow.app.pages.runs import report
from agentflow.cli import main
from agentflow.cli.display.show_runs import show_result
from agentflow.config.run import build_config
from agentflow.env.tasks.registry import LevelFile
from agentflow.errors import ConfigError
from agentflow.runs import read_calls, read_result

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(list(words)) == 2
    return capsys.readouterr().err


def test_a_finished_run_without_a_score_has_a_page(tmp_path: Path) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    content = json.loads((run / "result.json").read_text())
    content |= {"score": None, "verified": None, "valid": False, "machine": None, "reason": "none"}
    (run / "result.json").write_text(json.dumps(content))
    page = report(run, tmp_path / "page.html", films=0, workers=1, say=lambda *_: None)
    assert page.stat().st_size


def test_malformed_tool_calls_in_a_record_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    first, *lines = (run / "calls.jsonl").read_text().splitlines()
    call = json.loads(first)
    for forged in ([{"name": "check"}], 7, ["check"]):
        call["reply"]["tool_calls"] = forged
        (run / "calls.jsonl").write_text("\n".join([json.dumps(call), *lines]) + "\n")
        told = refusal(capsys, "report", str(run), "--out", str(tmp_path / "page.html"))
        assert "line 1: reply.tool_calls" in told
    assert next(iter(read_calls(RECORDED)))


@pytest.mark.parametrize("good", [float("nan"), float("inf"), -1.0, 0.0, "1e400"])
def test_a_good_score_is_a_number_above_zero(good: Any) -> None:
    with pytest.raises(ValueError, match="good"):
        LevelFile(family="movement", title="", good=good)


def test_ten_million_submissions_are_refused() -> None:
    with pytest.raises(ConfigError, match="candidates_per_stage: must be at most"):
        build_config({"settings": {"candidates_per_stage": 10**7}})


def test_a_setting_at_the_top_of_a_file_is_one_of_the_workflow() -> None:
    assert build_config({"external": {"command": "x"}}).settings.external.command == "x"


def test_a_missing_folder_is_no_model_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("training").mkdir()
    for name in ("training/none", "./none", str(tmp_path / "none")):
        told = refusal(capsys, "evaluate", name, "--task", "movement", "--out", "found")
        assert f"{name} is not a folder" in told
    assert not Path("found").exists()


def test_options_of_design_that_cannot_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert "choose a shorter one" in refusal(capsys, "design", "--name", "x" * 300)
    told = refusal(
        capsys,
        "design",
        "--resume",
        str(RECORDED),
        "--workers",
        "3",
        "--model",
        "m",
        "--set",
        "a=1",
    )
    assert "remove the other options: --workers, --model, --set" in told


def test_a_stage_that_scored_lower_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    content = read_result(RECORDED).to_json()
    show_result(content, {})
    assert "is kept" not in capsys.readouterr().out
    content["stages"][1]["max"] = content["stages"][0]["max"] - 1
    show_result(content, {})
    told = " ".join(capsys.readouterr().out.split())
    assert (
        "blind_refinement changes machines without having seen them simulated, and scored below "
        "initial: a stage's scores are those of the machines it made; the best machine of all "
        "stages is kept"
    ) in told
