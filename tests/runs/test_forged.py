"""Readers refuse damaged and forged runs in one line, and touch nothing outside them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.cli import main
from tests.runs.fuzz import make_source, summary

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"


@pytest.mark.slow
def test_mutated_runs(tmp_path: Path) -> None:
    """`benchmarks/forged.py` tries two thousand."""
    (tmp_path / "source").mkdir()
    (tmp_path / "copies").mkdir()
    counts, faults = summary(make_source(tmp_path / "source"), tmp_path / "copies", 60, seed=3)
    assert faults == []
    for reader in ("show", "failures", "report", "rescore", "replay", "resume", "table usage"):
        assert counts[f"{reader}: ok"] > 6, reader
        assert counts[f"{reader}: refused"] > 6, reader


FORGED = {
    # file, dotted place in its first line (or in the whole file), value, what the error says
    "null tokens": ("calls.jsonl", "reply.usage.prompt", None, "line 1: reply.usage.prompt: Input"),
    "a numeric role": ("calls.jsonl", "request.role", 7, "line 1: request.role: Input should be"),
    "a message": ("calls.jsonl", "request.messages", 7, "line 1: request.messages: Input should"),
    "a latency": ("calls.jsonl", "reply.latency_s", "1", "line 1: reply.latency_s: Input should"),
    "a time": ("events.jsonl", "at", "now", "line 1"),
    "a score": ("result.json", "score", "9", "its score is '9'"),
    "a stage": ("result.json", "stages", [{}], "it lacks stages.0.name, stages.0.trajectories"),
    "no machine": ("result.json", "machine", None, "it is valid without a machine"),
    "no stages": ("result.json", "stages", [], "it is valid without a stage"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_value_is_named(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, place, value, problem = FORGED[name]
    run = tmp_path / "run"
    shutil.copytree(RECORDED, run)
    first, *lines = (
        (run / file).read_text().split("\n") if ".jsonl" in file else [(run / file).read_text()]
    )
    item = group = json.loads(first)
    *above, last = place.split(".")
    for key in above:
        group = group[key]
    group[last] = value
    (run / file).write_text("\n".join([json.dumps(item), *lines]))
    assert main(["show", str(run)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"agentflow: {run / file} is damaged")
    assert problem in error
    assert error.count("\n") == 1
