"""Owns a run directory: what is written when, one writer at a time, and reading it back (spec 6.1).

What the lines mean belongs to those who write them; starting and replaying runs is app.py's.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import yaml

from agentflow.errors import RunError

SCHEMA = 1
"""Version of the layout; written to run.yaml, refused when foreign."""


@dataclass(frozen=True)
class Event:
    """One thing that happened. `(kind, label)` is unique in a run; `data` holds no timings."""

    kind: str
    label: str
    data: Mapping[str, Any]


Listener = Callable[[Event], None]


class RunDirectory:
    """One run on disk, held by one process.

    Files: run.yaml (written first), calls.jsonl (the tape's), events.jsonl, machines/, rollouts/,
    result.json (written last). Every line is flushed when it is appended, so a killed process
    loses at most the line in flight.
    """

    def __init__(self, path: Path, held: IO[str], known: Iterable[Event]) -> None:
        self.path = path
        self._made: list[Path] = []
        """Folders that were made for this run, the deepest first."""
        self._held = held
        self._known = {(event.kind, event.label): event.data for event in known}
        self._started = time.monotonic()
        self._events = (path / "events.jsonl").open("a", encoding="utf-8")
        self.listeners: list[Listener] = []

    @classmethod
    def create(cls, out: Path, name: str, document: Mapping[str, Any]) -> RunDirectory:
        """Make `out/name` (with a number behind it when taken) and write run.yaml into it.

        Raises:
            RunError: The folder cannot be made or written.
        """
        try:
            made = [folder for folder in (out, *out.parents) if not folder.exists()]
            out.mkdir(parents=True, exist_ok=True)
            path = _fresh(out, name)
            (path / "machines").mkdir()
            (path / "rollouts").mkdir()
            _write(
                path / "run.yaml", yaml.safe_dump({"schema": SCHEMA, **document}, sort_keys=False)
            )
            run = cls(path, _hold(path), ())
            run._made = made
            return run
        except OSError as error:
            raise RunError(
                f"cannot write to {out}: {error.strerror}; choose another folder with --out"
            ) from None

    @classmethod
    def resume(cls, path: Path) -> RunDirectory:
        """Take up an unfinished run: recorded events are not written again.

        Raises:
            RunError: No run, a foreign schema, a damaged file, or another process holds it.
        """
        read_document(path)
        held = _hold(path)
        _drop_half_line(path / "events.jsonl")
        return cls(path, held, read_events(path))

    @property
    def tape(self) -> Path:
        """Where the calls are recorded."""
        return self.path / "calls.jsonl"

    def event(self, kind: str, label: str, **data: Any) -> None:
        """Append one event and tell the listeners.

        A resumed run does not write again what is recorded. What comes out otherwise this time (a
        rollout that had timed out) is appended: of events with one label the last holds.
        """
        event = Event(kind, label, data)
        if self._known.get((kind, label)) != json.loads(json.dumps(data)):
            at = round(time.monotonic() - self._started, 3)
            line = {"kind": kind, "label": label, "at": at, "data": data}
            try:
                self._events.write(json.dumps(line) + "\n")
                self._events.flush()
            except OSError as error:
                raise _full(self.path / "events.jsonl", error) from None
        for listener in self.listeners:
            listener(event)

    def save_machine(self, digest: str, text: str) -> None:
        """Keep a machine once, by content hash."""
        path = self.path / "machines" / f"{digest}.json"
        if not path.exists():
            _write(path, text + "\n")

    def finish(self, result: Mapping[str, Any]) -> None:
        """Write result.json; from then on the run is complete."""
        _write(self.path / "result.json", json.dumps(result, indent=1) + "\n")

    def close(self) -> None:
        """Give the run free for other processes."""
        self._held.close()
        with contextlib.suppress(OSError):  # a full disk has been reported by the write itself
            self._events.close()

    def discard(self) -> None:
        """Remove a run that never got an answer from its model."""
        self.close()
        shutil.rmtree(self.path)
        with contextlib.suppress(OSError):  # another run has come to lie there meanwhile
            for folder in self._made:
                folder.rmdir()


def read_document(path: Path) -> dict[str, Any]:
    """The content of run.yaml.

    Raises:
        RunError: There is none, it is damaged, or its schema is not this version's.
    """
    try:
        document = yaml.safe_load((path / "run.yaml").read_text(encoding="utf-8"))
    except OSError:
        raise RunError(f"{path} is no run: it has no readable run.yaml") from None
    except (yaml.YAMLError, ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or "schema" not in document:
        raise RunError(f"{path / 'run.yaml'} is damaged: expected a mapping with `schema`")
    if document["schema"] != SCHEMA:
        raise RunError(
            f"{path} has schema {document['schema']!r}, this version reads {SCHEMA}: "
            "use the agentflow version that wrote it"
        )
    return document


def read_events(path: Path) -> Iterator[Event]:
    """The recorded events in the order in which they happened, without a half-written last line.

    A label that a resumed run had to write again comes once, where it was written last.

    Raises:
        RunError: A line before the last is damaged.
    """
    last: dict[tuple[str, str], Event] = {}
    for number, line in enumerate(_whole_lines(path / "events.jsonl"), start=1):
        try:
            item = json.loads(line)
            event = Event(item["kind"], item["label"], item["data"])
            last.pop((event.kind, event.label), None)
            last[event.kind, event.label] = event
        except (ValueError, KeyError, TypeError, RecursionError):
            raise RunError(f"{path / 'events.jsonl'} is damaged in line {number}") from None
    yield from last.values()


def read_result(path: Path) -> dict[str, Any]:
    """The content of result.json.

    Raises:
        RunError: The run is unfinished or the file is damaged.
    """
    try:
        result = json.loads((path / "result.json").read_text(encoding="utf-8"))
    except OSError:
        raise RunError(
            f"{path} has no result.json: the run is unfinished; continue it with "
            f"agentflow design --resume {path}"
        ) from None
    except (ValueError, RecursionError):
        result = None
    if not isinstance(result, dict):
        raise RunError(f"{path / 'result.json'} is damaged: expected a JSON object")
    return result


def _fresh(out: Path, name: str) -> Path:
    for number in range(1, 1000):
        path = out / (name if number == 1 else f"{name}-{number}")
        try:
            path.mkdir()
        except FileExistsError:
            continue
        return path
    raise RunError(f"{out} holds a thousand runs named {name}; choose another folder with --out")


def _hold(path: Path) -> IO[str]:
    held = (path / "run.yaml").open("r", encoding="utf-8")
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        held.close()
        raise RunError(f"{path} is in use by another process; wait for it or stop it") from None
    return held


def _write(path: Path, text: str) -> None:
    """Write a whole file or nothing: a killed process leaves no half file under the final name."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    except OSError as error:
        raise _full(path, error) from None


def _full(path: Path, error: OSError) -> RunError:
    return RunError(f"cannot write {path}: {error.strerror}; what is recorded can be resumed")


def _whole_lines(path: Path) -> Iterator[str]:
    if not path.exists():
        return
    if not path.is_file():
        raise RunError(f"{path} is damaged: expected a file")
    with path.open("rb") as lines:
        for line in lines:
            if line.endswith(b"\n"):
                yield line.decode("utf-8", errors="replace")


def _drop_half_line(path: Path) -> None:
    if not path.exists():
        return
    with path.open("rb") as lines:
        whole = sum(len(line) for line in lines if line.endswith(b"\n"))
    os.truncate(path, whole)
