"""`agentflow diagnose` as a user types it, with a model at a real endpoint."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from agentflow.cli import main
from agentflow.metrics.tables import PUBLISHED
from tests.llm.hostile import body, completion, serving

Captured = pytest.CaptureFixture[str]


def ask(out: Path, *options: str, text: str = "[[0, 1]]") -> int:
    """The exit status of a diagnosis by a model that gives one reply to everything."""

    async def served() -> int:
        async with serving(body(json.dumps(completion(text)))) as server:
            arguments = ["diagnose", "overlap", "--model", "scripted", "--pairs", "3"]
            address = ["--base-url", server.base_url, "--out", str(out)]
            return await asyncio.to_thread(main, [*arguments, *address, *options])

    return asyncio.run(served())


def test_json_has_the_numbers_and_the_published_ones(tmp_path: Path, capsys: Captured) -> None:
    assert ask(tmp_path, "--json", "--published") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert (found["diagnostic"], found["model"], found["pairs"]) == ("overlap", "scripted", 3)
    assert {"accuracy", "precision", "f1"} <= found.keys()
    assert 1 <= found["questions"] <= 3
    assert len(found["published"]) == 8
    assert found["published"]["Gemini 2.5 Pro"] == 0.416
    assert ask(tmp_path) == 0  # finished: nothing is asked again


def test_the_table_separates_published_rows(tmp_path: Path, capsys: Captured) -> None:
    assert ask(tmp_path, "--published", text="\x1b[2J none") == 0
    out = capsys.readouterr().out
    ours, _, theirs = out.partition(PUBLISHED)
    assert "scripted" in ours
    assert "Gemini 2.5 Pro" in theirs
    assert "0.416" in theirs
    assert "\x1b" not in out
    assert "Replies without an answer" not in out  # it said "none"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["overlap"], "the procedural model answers no questions about machines: name a language"),
        (["facing", "--pairs", "3"], "--pairs does not apply to facing; use --questions"),
        (["overlap", "--questions", "3"], "--questions does not apply to overlap; use --pairs"),
        (
            ["outcome", "--published"],
            "only the diagnostic overlap has published values, not outcome",
        ),
        (["touch"], "Invalid value for 'DIAGNOSTIC'"),
        (["overlap", "--set", "verify=false"], "a diagnosis has no verify: it asks questions"),
    ],
)
def test_mistakes(arguments: list[str], message: str, tmp_path: Path, capsys: Captured) -> None:
    assert main(["diagnose", *arguments, "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
