"""Owns the reading of run directories: events and calls one at a time, result, state, lists.

Nothing here holds a run's lines in memory, nor changes a file.
"""

from __future__ import annotations

import fcntl
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from shlex import quote
from typing import Any, Literal

from agentflow.errors import RunError
from agentflow.runs.document import NAME
from agentflow.runs.lines import is_whole, object_in

EVENTS, CALLS, RESULT = "events.jsonl", "calls.jsonl", "result.json"
AGAIN = b'{"again": true, '
"""How the line of an event begins that replaces an earlier one of the same kind and label."""
State = Literal["done", "running", "stopped"]
"""Of a run: complete, under way in some process, or to be continued with `--resume`."""


@dataclass(frozen=True)
class Event:
    """One thing that happened. `(kind, label)` is unique in a run; `data` holds no timings."""

    kind: str
    label: str
    data: Mapping[str, Any]
    at: float = field(default=0.0, compare=False)
    """Seconds of work into the run; the time between a kill and a resumption does not count."""


def read_events(path: Path) -> Iterator[Event]:
    """The recorded events in order, one at a time, without a half-written last line.

    A label that a resumed run had to write again comes once, where it was written last. Memory
    does not grow with the number of events.

    Raises:
        RunError: A line before the last is damaged.
    """
    replaced: dict[tuple[str, str], int] = {}
    for number, line in whole_lines(path / EVENTS):
        if line.startswith(AGAIN):
            event = _event(line, path, number)
            replaced[event.kind, event.label] = number
    for number, line in whole_lines(path / EVENTS):
        event = _event(line, path, number)
        if replaced.get((event.kind, event.label), 0) <= number:
            yield event


def read_calls(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of calls.jsonl as data, one at a time: `key`, `model`, `request`, `reply`.

    Raises:
        RunError: A line before the last is damaged.
    """
    for number, line in whole_lines(path / CALLS):
        item = object_in(line)
        if item is None or not _is_call(item):
            raise RunError(f"{path / CALLS} is damaged in line {number}")
        yield item


def _is_call(item: Mapping[str, Any]) -> bool:
    request, reply = item.get("request"), item.get("reply")
    return (
        isinstance(item.get("model"), str)
        and isinstance(request, dict)
        and {"role", "label"} <= request.keys()
        and isinstance(reply, dict)
        and {"text", "latency_s", "retries"} <= reply.keys()
        and isinstance(reply.get("usage"), dict)
        and {"prompt", "completion", "reasoning", "cached"} <= reply["usage"].keys()
    )


def read_result(path: Path) -> dict[str, Any]:
    """The content of result.json.

    Raises:
        RunError: It is no run, unfinished, or the file is damaged.
    """
    try:
        text = (path / RESULT).read_bytes()
    except FileNotFoundError:
        if state_of(path) == "running":
            raise RunError(f"{path} has no {RESULT} yet: a process is at work on it") from None
        raise RunError(
            f"{path} has no {RESULT}: the run is unfinished; continue it with "
            f"agentflow design --resume {quote(str(path))}"
        ) from None
    except OSError as error:
        raise RunError(f"cannot read {path / RESULT}: {error.strerror}") from None
    result = object_in(text)
    if result is None:
        raise RunError(f"{path / RESULT} is damaged: expected a JSON object")
    return result


def state_of(path: Path) -> State:
    """Whether a run is complete, under way, or waiting to be resumed.

    Raises:
        RunError: It is no run, or cannot be read.
    """
    try:
        if (path / RESULT).exists():
            return "done"
        file = (path / NAME).open("rb")
    except OSError:
        raise RunError(f"{path} is no run: it has no readable {NAME}") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return "running"
    return "stopped"


def find_runs(folder: Path) -> Iterator[Path]:
    """The run directories in a folder and in its subfolders, by name; a run itself is one.

    What is inside a run is not looked through, nor are links to folders.

    Raises:
        RunError: A folder cannot be read.
    """
    try:
        if (folder / NAME).is_file():
            yield folder
            return
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
        inside = [entry for entry in entries if entry.is_dir() and not entry.is_symlink()]
    except OSError as error:
        raise RunError(f"cannot read {folder}: {error.strerror}") from None
    for entry in inside:
        yield from find_runs(entry)


def whole_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Number (from 1) and content of every whole line; none where there is no file.

    Raises:
        RunError: There is something that cannot be read.
    """
    try:
        if not path.exists():
            return
        if not path.is_file():
            raise RunError(f"{path} is damaged: expected a file")
        with path.open("rb") as lines:
            for number, line in enumerate(lines, start=1):
                if is_whole(line):
                    yield number, line
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from None


def _event(line: bytes, path: Path, number: int) -> Event:
    item = object_in(line)
    if item is not None:
        kind, label, data = item.get("kind"), item.get("label"), item.get("data")
        if isinstance(kind, str) and isinstance(label, str) and isinstance(data, dict):
            return Event(kind, label, data, item.get("at", 0.0))
    raise RunError(f"{path / EVENTS} is damaged in line {number}")
