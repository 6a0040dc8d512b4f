"""Reading run directories: events and calls one at a time, result, state, lists of runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from shlex import quote
from typing import Any, Literal

from agentflow.errors import RunError
from agentflow.files import lock_file, parse_object, whole_lines
from agentflow.runs.document import FILE_NAME

EVENTS, CALLS, RESULT = "events.jsonl", "calls.jsonl", "result.json"
MACHINES = "machines"
AGAIN = b'{"again": true, '
"""Start of the line of an event that replaces an earlier one with the same kind and label."""
State = Literal["done", "running", "stopped"]
"""State of a run: complete, running in some process, or stopped before its end."""


@dataclass(frozen=True)
class Event:
    """One thing that happened. `(kind, label)` is unique in a run; `data` holds no timings."""

    kind: str
    label: str
    data: Mapping[str, Any]
    at: float = field(default=0.0, compare=False)
    """Seconds of work into the run, without the time between a kill and a resumption."""
    line: int = field(default=0, compare=False)
    """Line number in the file; 0 if it was not read from one."""


def read_events(path: Path) -> Iterator[Event]:
    """The recorded events in order, without a half-written last line.

    Of events with the same kind and label, only the last one is yielded. Memory use does not grow
    with the number of events.

    Raises:
        RunError: A line before the last is damaged.
    """
    replaced: dict[tuple[str, str], int] = {}
    for number, line in numbered_lines(path / EVENTS):
        if line.startswith(AGAIN):
            event = _parse_event(line, path, number)
            replaced[event.kind, event.label] = number
    for number, line in numbered_lines(path / EVENTS):
        event = _parse_event(line, path, number)
        if replaced.get((event.kind, event.label), 0) <= number:
            yield event


def read_new_events(path: Path, offset: int) -> tuple[list[Event], int]:
    """The events whose lines are complete beyond a byte offset, and the offset behind them.

    Events that replace earlier ones are among them, as they come.

    Raises:
        RunError: A line is damaged.
    """
    try:
        with (path / EVENTS).open("rb") as lines:
            lines.seek(offset)
            content = lines.read()
    except FileNotFoundError:
        return [], offset
    except OSError as error:
        raise RunError(f"cannot read {path / EVENTS}: {error.strerror}") from None
    end = content.rfind(b"\n") + 1
    found = [_parse_event(line, path, 0) for line in content[:end].splitlines()]
    return found, offset + end


def read_machine_text(path: Path, digest: str) -> str:
    """The text of a machine of a run, by its content hash.

    Raises:
        RunError: It cannot be read.
    """
    try:
        return (path / MACHINES / f"{digest}.json").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise RunError(f"{path} is damaged: it has no readable {MACHINES}/{digest}.json") from None


def read_result(path: Path) -> dict[str, Any]:
    """The content of result.json.

    Raises:
        RunError: The run is unfinished, or the file is damaged.
    """
    try:
        text = (path / RESULT).read_bytes()
    except FileNotFoundError:
        if state_of(path) == "running":
            raise RunError(f"{path} has no {RESULT} yet: a process is working on it") from None
        raise RunError(
            f"{path} has no {RESULT}: the run is unfinished; continue it with "
            f"agentflow design --resume {quote(str(path))}"
        ) from None
    except OSError as error:
        raise RunError(f"cannot read {path / RESULT}: {error.strerror}") from None
    result = parse_object(text)
    if result is None:
        raise RunError(f"{path / RESULT} is damaged: expected a JSON object")
    return result


def state_of(path: Path) -> State:
    """Whether a run is complete, running, or waiting to be resumed.

    Raises:
        RunError: It is not a run directory.
    """
    try:
        if (path / RESULT).exists():
            return "done"
        file = (path / FILE_NAME).open("rb") if (path / FILE_NAME).is_file() else None
    except OSError:
        file = None
    if file is None:
        raise RunError(f"{path} is not a run directory: it has no readable {FILE_NAME}")
    with file:
        try:
            lock_file(file.fileno(), shared=True)
        except OSError:
            return "running"
    return "stopped"


def find_runs(folder: Path) -> Iterator[Path]:
    """The run directories in a folder and its subfolders, by name; `folder` may be a run itself.

    Runs inside runs are not found; links to folders are not followed.
    """
    try:
        if (folder / FILE_NAME).is_file():
            yield folder
            return
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
        inside = [entry for entry in entries if entry.is_dir() and not entry.is_symlink()]
    except OSError as error:
        raise RunError(f"cannot read {folder}: {error.strerror}") from None
    for entry in inside:
        yield from find_runs(entry)


def numbered_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Number (from 1) and content of every complete line; none if there is no file."""
    try:
        if not path.exists():
            return
        if not path.is_file():
            raise RunError(f"{path} is damaged: expected a file")
        yield from whole_lines(path)
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from None


def _parse_event(line: bytes, path: Path, number: int) -> Event:
    item = parse_object(line)
    if item is not None:
        kind, label, data = item.get("kind"), item.get("label"), item.get("data")
        at = item.get("at", 0.0)
        timed = type(at) in (int, float) and isfinite(at)
        if timed and isinstance(kind, str) and isinstance(label, str) and isinstance(data, dict):
            return Event(kind, label, data, at, number)
    raise RunError(f"{path / EVENTS} is damaged in line {number}")
