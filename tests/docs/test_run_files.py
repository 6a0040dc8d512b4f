"""The page about the files of a run names all of them, and all their keys."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

from agentflow.runs.events import CallsEvent, DrawingEvent, RunEvent
from agentflow.runs.result import RunResult
from tests.pages import page, rows

RECORDED = Path(__file__).parents[2] / "runs/recorded-throwing"
SHOWN_ONLY = {CallsEvent.kind, DrawingEvent.kind}
"""Events that are not recorded."""


def first_cells(heading: str) -> set[str]:
    """The words in backticks in the first column of a section's table."""
    _, _, after = page("runs.md").partition(f"### {heading}\n")
    section = re.split(r"(?m)^##", after)[0]
    return {word for cells in rows(section) for word in re.findall(r"`(\w+)`", cells[0])}


def keys(file: str) -> set[str]:
    """The keys of a recorded file, or of its first line."""
    text = (RECORDED / file).read_text(encoding="utf-8")
    return set(yaml.safe_load(text) if file == "run.yaml" else json.loads(text.splitlines()[0]))


def test_every_kind_of_event_is_listed() -> None:
    ours = {
        kind for kind, event in RunEvent.kinds.items() if event.__module__ == RunEvent.__module__
    }
    assert first_cells("events.jsonl") == ours - SHOWN_ONLY


def test_every_key_of_a_result_is_listed() -> None:
    assert first_cells("result.json") | {"reason"} == set(RunResult.model_fields)


@pytest.mark.parametrize(
    ("file", "younger"),
    [("run.yaml", {"began", "plugins", "prompt_folder"}), ("calls.jsonl", {"after", "shared"})],
)
def test_every_key_is_listed(file: str, younger: set[str]) -> None:
    assert first_cells(file) == keys(file) | younger


def test_every_file_of_a_run_is_listed() -> None:
    listed = {cells[0].strip("`").partition("/")[0] for cells in rows(page("runs.md"))}
    assert {path.name for path in RECORDED.iterdir()} <= listed
