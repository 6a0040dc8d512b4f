"""Reading run directories in any state, line by line, including damaged ones."""

from __future__ import annotations

import json
import tracemalloc
from pathlib import Path

import pytest

from agentflow.errors import RunError
from agentflow.runs import (
    Event,
    RunDirectory,
    find_runs,
    read_calls,
    read_events,
    read_result,
    state_of,
)
from tests.runs.results import a_result


def made(folder: Path, name: str = "demo") -> Path:
    run = RunDirectory.create(folder, name, {})
    run.close()
    return run.path


def write_events(path: Path, count: int) -> None:
    with (path / "events.jsonl").open("w") as lines:
        for number in range(count):
            event = {
                "kind": "attempt",
                "label": f"a/{number}",
                "at": 1.0,
                "data": {"text": "x" * 200},
            }
            lines.write(json.dumps(event) + "\n")


def peak(path: Path) -> tuple[int, int]:
    """Number of events read, and peak memory in bytes."""
    tracemalloc.start()
    try:
        count = sum(1 for _ in read_events(path))
        return count, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_events_are_read_in_constant_memory(tmp_path: Path) -> None:
    path = made(tmp_path)
    write_events(path, 30_000)
    count, held = peak(path)
    assert count == 30_000
    assert held < 200_000  # the lines themselves are 7 MB


@pytest.mark.parametrize(
    "line",
    [
        "nonsense",
        "[]",
        "{}",
        '{"kind": "a", "label": "b"}',
        '{"kind": 1, "label": "b", "data": {}}',
        '{"kind": "a", "label": "b", "data": []}',
        "[" * 30_000,
    ],
)
def test_a_damaged_middle_line_is_named(tmp_path: Path, line: str) -> None:
    path = made(tmp_path)
    good = '{"kind": "a", "label": "b", "at": 1.5, "data": {}}'
    (path / "events.jsonl").write_text(f"{good}\n{line}\n{good}\n")
    events = read_events(path)
    first = next(events)
    assert (first, first.at) == (Event("a", "b", {}), 1.5)
    with pytest.raises(RunError) as caught:
        next(events)
    assert str(caught.value) == f"{path / 'events.jsonl'} is damaged in line 2"


def test_a_half_written_last_line_is_skipped(tmp_path: Path) -> None:
    path = made(tmp_path)
    (path / "events.jsonl").write_text(
        '{"kind": "a", "label": "b", "data": {}}\n{"kind": "a", "lab'
    )
    assert list(read_events(path)) == [Event("a", "b", {})]


def test_calls_are_data(tmp_path: Path) -> None:
    path = made(tmp_path)
    usage = {"prompt": 1, "completion": 2, "reasoning": 0, "cached": 0}
    reply = {"text": "t", "latency_s": 0.5, "retries": 0, "usage": usage}
    call = {"key": "k", "model": "m", "request": {"role": "r", "label": "r/1"}, "reply": reply}
    (path / "calls.jsonl").write_text(json.dumps(call) + '\n{"key"')
    assert list(read_calls(path)) == [call]
    for damage in ({"model": 1}, {"request": {}}, {"reply": []}, {"reply": {**reply, "usage": {}}}):
        (path / "calls.jsonl").write_text(json.dumps({**call, **damage}) + "\n")
        with pytest.raises(RunError, match=r"calls\.jsonl is damaged in line 1"):
            list(read_calls(path))


def test_a_run_without_files_has_no_events_or_calls(tmp_path: Path) -> None:
    assert list(read_events(tmp_path)) == list(read_calls(tmp_path)) == []


def test_a_folder_in_place_of_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").mkdir()
    with pytest.raises(RunError, match=r"events\.jsonl is damaged: expected a file"):
        list(read_events(tmp_path))


@pytest.mark.parametrize("text", ["", "[1]", '{"score": ', "\x00\xff"])
def test_a_damaged_result_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "result.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(RunError, match=r"result\.json is damaged: expected a JSON object"):
        read_result(tmp_path)


def test_states(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path, "my demo", {})
    assert state_of(run.path) == "running"
    with pytest.raises(RunError, match=r"has no result\.json yet: a process is working on it$"):
        read_result(run.path)
    run.close()
    assert state_of(run.path) == "stopped"
    with pytest.raises(RunError, match=r"continue it with agentflow design --resume '.*my demo'$"):
        read_result(run.path)
    again = RunDirectory.resume(run.path)
    again.finish(a_result(score=1.0))
    assert state_of(run.path) == "done"
    again.close()


def test_runs_are_found_in_nested_folders_but_not_in_runs(tmp_path: Path) -> None:
    first = made(tmp_path / "b" / "c")
    second = made(tmp_path / "a")
    made(first, "inside")
    (tmp_path / "file").write_text("")
    (tmp_path / "b" / "loop").symlink_to(tmp_path)
    assert list(find_runs(tmp_path)) == [second, first]
    assert list(find_runs(first)) == [first]
    assert list(find_runs(tmp_path / "none")) == []
