"""Readers refuse damaged and forged runs in one line, and touch nothing outside them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from agentflow.cli import main
from tests.runs.fuzz import outcomes, summary
from tests.runs.sources import make_sources

RECORDED = Path(__file__).parents[2] / "runs" / "recorded-throwing"


@pytest.mark.slow
def test_mutated_files(tmp_path: Path) -> None:
    """`benchmarks/forged.py` tries ten thousand, of more kinds."""
    (tmp_path / "copies").mkdir()
    sources = make_sources(tmp_path / "sources", ("sweep", "session", "files", "study"))
    counts, faults = summary(outcomes(sources, tmp_path / "copies", range(120), seed=3))
    assert faults == []
    for kind in sources:
        for outcome in ("ok", "refused"):
            assert sum(counts[n] for n in counts if n.startswith(kind) and n.endswith(outcome)) > 9


FORGED = {
    # file, dotted place in its first line (or in the whole file), value, what the error says
    "null tokens": ("calls.jsonl", "reply.usage.prompt", None, "line 1: reply.usage.prompt: Input"),
    "a numeric role": ("calls.jsonl", "request.role", 7, "line 1: request.role: Input should be"),
    "a message": ("calls.jsonl", "request.messages", 7, "line 1: request.messages: Input should"),
    "a latency": ("calls.jsonl", "reply.latency_s", "1", "line 1: reply.latency_s: Input should"),
    "a time": ("events.jsonl", "at", "now", "line 1"),
    "a score": ("result.json", "score", "9", "its score is '9'"),
    "a stage": ("result.json", "stages", [{}], "it lacks stages.0.name, stages.0.trajectories"),
    "a count of tools": (
        "result.json",
        "stages.0.tools",
        {"check": 1},
        "its stages.0.tools.check is '1'",
    ),
    "no machine": ("result.json", "machine", None, "it is valid without a machine"),
    "no stages": ("result.json", "stages", [], "it is valid without a stage"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_value_is_named(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, place, value, problem = FORGED[name]
    run = shutil.copytree(RECORDED, tmp_path / "run")
    first, *lines = (
        (run / file).read_text().split("\n") if ".jsonl" in file else [(run / file).read_text()]
    )
    item = group = json.loads(first)
    *above, last = place.split(".")
    for key in above:
        group = group[int(key) if key.isdigit() else key]
    group[last] = value
    (run / file).write_text("\n".join([json.dumps(item), *lines]))
    assert main(["show", str(run)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"agentflow: {run / file} is damaged")
    assert problem in error
    assert error.count("\n") == 1
