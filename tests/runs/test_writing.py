"""Run directories: writing, resuming, discarding."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from agentflow.errors import RunError
from agentflow.runs import (
    Event,
    RunDirectory,
    read_document,
    read_events,
    read_result,
)
from tests.runs.results import a_result


def test_a_run_reads_back_what_was_written(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path / "deep" / "runs", "demo", {"config": {"seed": 3}})
    heard: list[Event] = []
    run.listeners.append(heard.append)
    run.event(Event("stage", "initial", {"valid": 2}))
    run.event(Event("stage", "blind_refinement", {"valid": 1}))
    run.save_machine("ab12", "[]")
    run.finish(a_result(score=1.5))
    run.close()
    assert read_document(run.path) == {"schema": 1, "config": {"seed": 3}}
    assert list(read_events(run.path)) == heard
    assert heard[0] == Event("stage", "initial", {"valid": 2})
    assert read_result(run.path) == a_result(score=1.5)
    assert (run.path / "machines" / "ab12.json").read_text() == "[]\n"


def test_duplicate_names_get_a_number(tmp_path: Path) -> None:
    first = RunDirectory.create(tmp_path, "demo", {})
    second = RunDirectory.create(tmp_path, "demo", {})
    assert [first.path.name, second.path.name] == ["demo", "demo-2"]
    first.close()
    second.close()


@pytest.mark.slow
def test_a_second_writer_is_refused_until_the_first_ends(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    with pytest.raises(RunError, match="is in use by another process"):
        RunDirectory.resume(run.path)
    run.close()
    RunDirectory.resume(run.path).close()


def test_resume_drops_a_half_written_line_and_repeats_nothing(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    run.event(Event("attempt", "designer/1", {"code": ""}))
    run.close()
    with (run.path / "events.jsonl").open("a") as file:
        file.write('{"kind": "att')
    again = RunDirectory.resume(run.path)
    assert again.dropped == len('{"kind": "att')
    again.event(Event("attempt", "designer/1", {"code": ""}))
    again.event(Event("attempt", "designer/2", {"code": "overlap"}))
    again.close()
    lines = (run.path / "events.jsonl").read_text().splitlines()
    labels = [json.loads(line)["label"] for line in lines]
    assert labels == ["designer/1", "designer/2"]


def test_resume_keeps_a_complete_line_without_its_line_break(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    run.event(Event("attempt", "designer/1", {"code": ""}))
    run.close()
    recorded = (run.path / "events.jsonl").read_bytes()
    (run.path / "events.jsonl").write_bytes(recorded[:-1])
    assert [event.label for event in read_events(run.path)] == ["designer/1"]
    again = RunDirectory.resume(run.path)
    assert again.dropped == 0
    again.event(Event("attempt", "designer/1", {"code": ""}))
    again.close()
    assert (run.path / "events.jsonl").read_bytes() == recorded


def test_resume_keeps_events_that_are_not_reproduced(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    assert (run.resumed, list(run.unreproduced())) == (False, [])
    for label in "abc":
        run.event(Event("attempt", label, {"code": ""}))
    assert list(run.unreproduced()) == []
    run.close()
    again = RunDirectory.resume(run.path)
    again.event(Event("attempt", "b", {"code": "overlap"}))
    again.event(Event("attempt", "d", {"code": ""}))
    assert [event.label for event in again.unreproduced()] == ["a", "c"]
    assert again.resumed
    again.close()
    assert [event.label for event in read_events(run.path)] == ["a", "c", "b", "d"]


def test_an_unwritable_folder_names_the_flag(tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(RunError, match="choose another folder with --out"):
        RunDirectory.create(blocker / "runs", "demo", {})
    assert os.listdir(tmp_path) == ["file"]


def test_a_discarded_run_leaves_nothing_behind(tmp_path: Path) -> None:
    RunDirectory.create(tmp_path / "runs", "demo", {}).discard()
    assert os.listdir(tmp_path) == []
    (tmp_path / "runs").mkdir()
    RunDirectory.create(tmp_path / "runs", "demo", {}).discard()
    assert os.listdir(tmp_path) == ["runs"]


def test_the_last_version_of_an_event_counts(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    run.event(Event("evaluation", "a", {"status": "timeout", "score": None}))
    run.event(Event("evaluation", "b", {"status": "ok", "score": 1.0}))
    run.close()
    again = RunDirectory.resume(run.path)
    again.event(Event("evaluation", "a", {"status": "ok", "score": 12.0}))
    again.event(Event("evaluation", "b", {"status": "ok", "score": 1.0}))
    assert [event.label for event in again.replaced] == ["a"]
    again.close()
    assert list(read_events(run.path)) == [
        Event("evaluation", "b", {"status": "ok", "score": 1.0}),
        Event("evaluation", "a", {"status": "ok", "score": 12.0}),
    ]
    assert len((run.path / "events.jsonl").read_text().splitlines()) == 3


def test_equal_data_is_not_written_again_in_any_key_order(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "demo", {})
    run.event(Event("stage", "a", {"counts": {2: "two", 10: "ten"}, "valid": (1, 2)}))
    run.close()
    again = RunDirectory.resume(run.path)
    again.event(Event("stage", "a", {"valid": [1, 2], "counts": {"10": "ten", "2": "two"}}))
    assert again.replaced == []
    again.close()
    assert len((run.path / "events.jsonl").read_text().splitlines()) == 1


def test_discarding_a_run_keeps_other_runs(tmp_path: Path) -> None:
    first = RunDirectory.create(tmp_path / "runs", "demo", {})
    second = RunDirectory.create(tmp_path / "runs", "demo", {})
    first.discard()
    assert os.listdir(tmp_path / "runs") == ["demo-2"]
    second.close()
