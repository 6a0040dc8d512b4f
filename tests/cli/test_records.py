"""The commands on recorded runs and on configurations, as a user sees them."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from agentflow.cli import main
from agentflow.env.archive import load_npz, save_npz
from agentflow.env.rollout import Marginal
from agentflow.holding import with_holding
from agentflow.machine import read_machine
from agentflow.metrics.failure_kinds import KINDS
from agentflow.runs import read_document, read_result

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"
Captured = pytest.CaptureFixture[str]


def shown(capsys: Captured, *arguments: str) -> str:
    assert main(list(arguments)) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return captured.out


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file and what it holds."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_runs_are_one_line_each_however_long_the_path(tmp_path: Path, capsys: Captured) -> None:
    run = shutil.copytree(RECORDED, tmp_path / ("a" * 100) / "run")
    head, line, engine = shown(capsys, "runs", str(tmp_path)).splitlines()
    assert head.split() == [
        *("run", "state", "task", "workflow", "model", "seed"),
        *("score", "verified", "cost"),
    ]
    assert line.split()[:4] == [str(run), "done", "throwing", "hierarchical"]
    assert engine == f"engine: {read_document(RECORDED)['engine']}"
    (item,) = json.loads(shown(capsys, "runs", str(tmp_path), "--json"))
    assert (item["run"], item["state"]) == (str(run), "done")


def test_a_folder_without_runs_says_so(tmp_path: Path, capsys: Captured) -> None:
    assert shown(capsys, "runs", str(tmp_path)) == "no runs\n"
    assert shown(capsys, "runs", str(tmp_path), "--json") == "[]\n"


def test_a_damaged_run_does_not_hide_the_others(tmp_path: Path, capsys: Captured) -> None:
    shutil.copytree(RECORDED, tmp_path / "good")
    shutil.copytree(RECORDED, tmp_path / "bad")
    (tmp_path / "bad" / "result.json").write_text("{")
    why, _, bad, good, _ = shown(capsys, "runs", str(tmp_path)).splitlines()
    assert why == f"{tmp_path / 'bad' / 'result.json'} is damaged: expected a JSON object"
    assert bad.split()[1:] == ["damaged", "-", "-", "-", "-", "-", "-", "-"]
    assert good.split()[1] == "done"


def test_a_finished_run_that_is_resumed_keeps_every_byte(tmp_path: Path, capsys: Captured) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    for picture in ("best.png", "best.gif"):  # the recorded run has none, to be small
        (run / picture).write_bytes(b"drawn")
    before = contents(run)
    out = shown(capsys, "design", "--resume", str(run), "--json", "--quiet")
    result = read_result(RECORDED).to_json()
    verified = with_holding(result["verified"])
    assert json.loads(out) == {**result, "verified": verified, "run": str(run)}
    assert verified is not None
    assert (verified["holds"], verified["fragile"]) == (8, False)
    assert contents(run) == before


def test_show_tells_stages_costs_and_failures(capsys: Captured) -> None:
    lines = shown(capsys, "show", str(RECORDED)).splitlines()
    assert lines[0] == f"{RECORDED}: done"
    engine = read_document(RECORDED)["engine"]
    assert lines[1] == f"throwing, hierarchical, procedural (no language model), seed 0, {engine}"
    result = read_result(RECORDED)
    best, last = f"{result.score:.2f}", result.stages[-1]
    blocks = f"{len(result.machine)} of 40 blocks"
    assert lines[2] == f"best score {best}, {blocks}, found in stage {result.best_stage}"
    (row,) = (line.split() for line in lines if line.startswith("env_feedback"))
    assert row[1:4] == ["2/2", "2/2", f"{last.mean:.2f}"]
    assert row[4:] == [f"{last.max:.2f}", str(last.calls), str(last.rollouts)]
    told = f"0 of {result.calls} replies rejected; {result.rollouts} machines simulated"
    assert told in lines
    assert json.loads(shown(capsys, "show", str(RECORDED), "--json"))["state"] == "done"


def test_show_names_marginal_connections_of_the_best_machine(
    tmp_path: Path, capsys: Captured
) -> None:
    run = shutil.copytree(RECORDED, tmp_path / "run")
    machine = read_machine(read_result(run).machine).machine
    assert machine is not None
    file = run / "rollouts" / f"{machine.digest}.npz"
    save_npz(replace(load_npz(file), marginal=(Marginal(2, 15, 1, 0.5, 0.97),)), file)
    line = "marginal: block 2 off block 1 nearly broke (97 % of its strength, 0.50 s)"
    assert line in " ".join(shown(capsys, "show", str(run)).split())
    (item,) = json.loads(shown(capsys, "show", str(run), "--json"))["marginal"]
    assert (item["block"], item["load"]) == (2, 0.97)
    file.unlink()
    assert "marginal:" not in shown(capsys, "show", str(run))
    assert json.loads(shown(capsys, "show", str(run), "--json"))["marginal"] is None


def test_failures_are_a_table(capsys: Captured) -> None:
    lines = shown(capsys, "failures", str(RECORDED)).splitlines()
    machines = str(read_result(RECORDED).rollouts)
    (row,) = (line.split() for line in lines if line.startswith("planning      no motion"))
    assert (row[:3], row[-2:]) == (["planning", "no", "motion"], [machines, "machines"])
    assert len(lines) == 2 + len(KINDS)


def test_a_configuration_is_shown_as_one(capsys: Captured, tmp_path: Path) -> None:
    text = shown(capsys, "config", "show", "--set", "search.rounds=2")
    assert "    rounds: 2                                       # --set\n" in text
    (tmp_path / "again.yaml").write_text(text)
    assert shown(capsys, "config", "show", "--config", str(tmp_path / "again.yaml"), "--json")
    found = json.loads(shown(capsys, "config", "show", "--set", "search.rounds=2", "--json"))
    assert found["config"] == yaml.safe_load(text)
    assert found["from"]["settings.search.rounds"] == "--set"


@pytest.mark.parametrize("command", ["show", "rescore", "failures", "runs"])
def test_what_is_no_run_is_one_line(command: str, tmp_path: Path, capsys: Captured) -> None:
    assert main([command, str(tmp_path / "none")]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("agentflow: ")
    assert captured.err.count("\n") == 1
