"""Writing a run directory, one process at a time."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from agentflow.errors import RunError
from agentflow.files.atomic import os_errors, remove_partial_files, write_file, write_text
from agentflow.files.folders import lock_file, out_errors
from agentflow.files.lines import LineFile
from agentflow.runs import reading
from agentflow.runs.events import RunEvent, read_stage
from agentflow.runs.result import RunResult

ROLLOUTS, LOG = "rollouts", "log.txt"
ATTEMPTS, PAUSE = 50, 0.01
"""Lock attempts, and seconds between them: `state_of` locks a run for a moment."""
Listener = Callable[[RunEvent | reading.Event], None]
"""Receives every event of a run."""
Notify = Callable[[str], None]
"""Receives one line of text for the user, e.g. about a retry or an unsupported parameter."""


class RunDirectory:
    """One run on disk, locked by this process.

    Files: run.yaml (written first), calls.jsonl (written by the call log), events.jsonl, machines/,
    rollouts/, log.txt (what programs print), result.json (written last). Events are on disk when
    `event` returns, and other files are replaced atomically, so a killed process loses at most what
    it was writing.
    """

    def __init__(self, path: Path, lock: IO[str]) -> None:
        """Open the run at `path`; `lock` is its run.yaml, open and locked."""
        self.path = path
        self.listeners: list[Listener] = []
        self.replaced: list[RunEvent | reading.Event] = []
        """Events that differ from what an earlier process recorded."""
        self.resumed = True
        """Whether an earlier process started it."""
        self._made: list[Path] = []
        """Folders created for this run, deepest first."""
        self._lock = lock
        self._known: dict[bytes, bytes] = {}
        """Hash of kind and label -> hash of the data, for events recorded by an earlier process."""
        self._reproduced: set[bytes] = set()
        """Keys of `_known` that this process has reproduced."""
        worked = 0.0
        for event in reading.read_events(path):
            self._known[_hash(event.kind, event.label)] = _hash(event.data)
            worked = max(worked, event.at)
        self._started = time.monotonic() - worked
        for folder in (reading.MACHINES, ROLLOUTS):
            (path / folder).mkdir(exist_ok=True)
            remove_partial_files(path / folder)
        remove_partial_files(path)
        self._events = LineFile(path / reading.EVENTS)

    @classmethod
    def create(cls, out: Path, name: str, document: Mapping[str, Any]) -> RunDirectory:
        """Create `out/name` (with a number if that exists) and write its run.yaml."""
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        path: Path | None = None
        try:
            with out_errors(out):
                out.mkdir(parents=True, exist_ok=True)
                path = _make_folder(out, name)
                write_text(path / reading.FILE_NAME, reading.document_text(document))
                run = cls(path, _lock(path))
        except RunError:
            _remove(path, made)
            raise
        run.resumed, run._made = False, made
        return run

    @classmethod
    def resume(cls, path: Path) -> RunDirectory:
        """Open an unfinished run; recorded events are not written again."""
        reading.read_document(path)
        lock = _lock(path)
        try:
            with os_errors(f"cannot write to {path}"):
                return cls(path, lock)
        except BaseException:
            lock.close()
            raise

    @property
    def seconds(self) -> float:
        """Seconds of work into the run."""
        return time.monotonic() - self._started

    @property
    def call_log(self) -> Path:
        """Where the calls are recorded."""
        return self.path / reading.CALLS

    def event(self, event: RunEvent | reading.Event) -> None:
        """Append one event, with the time of now, and notify the listeners.

        A resumed run does not append recorded events again, unless they differ (as after a rollout
        that had timed out); the last event with a kind and label counts.
        """
        event = replace(event, at=round(self.seconds, 3))
        data = event.data
        key = _hash(event.kind, event.label) if self._known else b""
        recorded = self._known.get(key)
        if recorded is not None:
            self._reproduced.add(key)
        if recorded is None or recorded != _hash(data):
            item = {"kind": event.kind, "label": event.label, "at": event.at, "data": data}
            line = json.dumps(item).encode()
            self._events.append(line if recorded is None else reading.AGAIN + line[1:])
            if recorded is not None:
                self.replaced.append(event)
        self.notify(event)

    def notify(self, event: RunEvent | reading.Event) -> None:
        """Pass an event to the listeners without recording it."""
        for listener in self.listeners:
            listener(event)

    @property
    def dropped(self) -> int:
        """Bytes of a half-written last event that an earlier process left."""
        return self._events.dropped

    def unreproduced(self) -> Iterator[reading.Event]:
        """Recorded events of an earlier process that this one has not reproduced so far."""
        for event in reading.read_events(self.path) if self._known else ():
            key = _hash(event.kind, event.label)
            if key in self._known and key not in self._reproduced:
                yield event

    def save_machine(self, digest: str, text: str) -> None:
        """Save a machine once, by content hash."""
        path = self.path / reading.MACHINES / f"{digest}.json"
        if not path.exists():
            write_file(path, text + "\n", RunError)

    def log(self, text: bytes) -> None:
        """Append what a program has printed."""
        file = self.path / LOG
        with os_errors(f"cannot write {file}"), file.open("ab") as log:
            log.write(text)

    def earlier(self, stage: str) -> Sequence[RunEvent]:
        """What an earlier process recorded in a stage."""
        return read_stage(self.path, stage) if self.resumed else ()

    def load_machine(self, digest: str) -> str:
        """The text of a stored machine."""
        return reading.read_machine_text(self.path, digest)

    def finish(self, result: RunResult) -> None:
        """Write result.json, which completes the run."""
        result.write(self.path)

    def close(self) -> None:
        """Close the run and release its lock."""
        self._events.close()
        self._lock.close()

    def discard(self) -> None:
        """Remove a run that never got a reply from its model."""
        self.close()
        _remove(self.path, self._made)


def _remove(path: Path | None, made: Sequence[Path]) -> None:
    """Remove a run, and the folders created for it that are now empty."""
    if path is not None:
        shutil.rmtree(path)
    for folder in made:
        with contextlib.suppress(OSError):  # never created, or used by another run
            folder.rmdir()


def _hash(*content: object) -> bytes:
    """Hash of JSON data; the order of keys does not matter."""
    text = json.dumps(json.loads(json.dumps(content)), sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).digest()


def _make_folder(out: Path, name: str) -> Path:
    for number in range(1, 1000):
        path = out / (name if number == 1 else f"{name}-{number}")
        with contextlib.suppress(FileExistsError):
            path.mkdir()
            return path
    raise RunError(f"{out} has a thousand runs named {name}; choose another folder with --out")


def _lock(path: Path) -> IO[str]:
    lock = (path / reading.FILE_NAME).open("r", encoding="utf-8")
    for _ in range(ATTEMPTS):
        try:
            lock_file(lock.fileno())
        except BlockingIOError:
            time.sleep(PAUSE)
        except OSError as error:
            lock.close()
            raise RunError(f"cannot lock {path / reading.FILE_NAME}: {error.strerror}") from None
        else:
            return lock
    lock.close()
    raise RunError(f"{path} is in use by another process; wait for it or stop it")
