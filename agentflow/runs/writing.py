"""Owns a run directory while it is written: what is written when, by one process at a time."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from agentflow.errors import RunError
from agentflow.runs.document import NAME, document_text, read_document
from agentflow.runs.lines import LineFile
from agentflow.runs.reading import AGAIN, CALLS, EVENTS, RESULT, Event, read_events

MACHINES, ROLLOUTS = "machines", "rollouts"
TRIES, PAUSE = 50, 0.01
"""How often a run is taken hold of, and seconds between: `state_of` holds it for a moment."""
Listener = Callable[[Event], None]


class RunDirectory:
    """One run on disk, held by one process.

    Files: run.yaml (written first), calls.jsonl (the tape's), events.jsonl, machines/, rollouts/,
    result.json (written last). A line is in the file when `event` returns, and whole files come
    into being at once, so a killed process loses at most what it was just writing.
    """

    def __init__(self, path: Path, held: IO[str]) -> None:
        """Take up the run at `path`, whose run.yaml is there and locked by `held`.

        Raises:
            RunError: The record is damaged.
            OSError: The folder cannot be written.
        """
        self.path = path
        self.listeners: list[Listener] = []
        self.replaced: list[Event] = []
        """Events that came out otherwise than an earlier process had recorded them."""
        self.resumed = True
        """Whether an earlier process began it."""
        self._made: list[Path] = []
        """Folders that were made to hold this run, the deepest first."""
        self._held = held
        self._known: dict[bytes, bytes] = {}
        """Hash of kind and label -> hash of the data, of what an earlier process recorded."""
        self._again: set[bytes] = set()
        """Those of them that have happened again."""
        worked = 0.0
        for event in read_events(path):
            self._known[_hash(event.kind, event.label)] = _hash(event.data)
            worked = max(worked, event.at)
        self._started = time.monotonic() - worked
        for folder in (MACHINES, ROLLOUTS):
            (path / folder).mkdir(exist_ok=True)
        self._events = LineFile(path / EVENTS)

    @classmethod
    def create(cls, out: Path, name: str, document: Mapping[str, Any]) -> RunDirectory:
        """Make `out/name` (with a number behind it when taken) and write run.yaml into it.

        Raises:
            RunError: The folder cannot be made or written.
        """
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        path: Path | None = None
        try:
            out.mkdir(parents=True, exist_ok=True)
            path = _fresh(out, name)
            _write(path / NAME, document_text(document))
            run = cls(path, _hold(path))
            run.resumed = False
        except OSError as error:
            _remove(path, made)
            raise RunError(
                f"cannot write to {out}: {error.strerror}; choose another folder with --out"
            ) from None
        run._made = made
        return run

    @classmethod
    def resume(cls, path: Path) -> RunDirectory:
        """Take up an unfinished run: recorded events are not written again.

        Raises:
            RunError: No run, a foreign schema, a damaged or edited file, a folder that cannot be
                written, or another process holds it.
        """
        read_document(path)
        held = _hold(path)
        try:
            return cls(path, held)
        except OSError as error:
            held.close()
            raise RunError(f"cannot write to {path}: {error.strerror}") from None
        except BaseException:
            held.close()
            raise

    @property
    def seconds(self) -> float:
        """Seconds of work into the run."""
        return time.monotonic() - self._started

    @property
    def tape(self) -> Path:
        """Where the calls are recorded."""
        return self.path / CALLS

    def event(self, kind: str, label: str, **data: Any) -> None:
        """Append one event and tell the listeners.

        A resumed run does not write again what is recorded. What comes out otherwise this time (a
        rollout that had timed out) is appended: of events with one label the last holds.

        Raises:
            RunError: The line could not be written.
        """
        event = Event(kind, label, data, round(self.seconds, 3))
        recorded = self._recorded(_hash(kind, label)) if self._known else None
        if recorded is None or recorded != _hash(data):
            item = {"kind": kind, "label": label, "at": event.at, "data": data}
            line = json.dumps(item).encode()
            try:
                self._events.append(line if recorded is None else AGAIN + line[1:])
            except OSError as error:
                raise _full(self.path / EVENTS, error) from None
            if recorded is not None:
                self.replaced.append(event)
        for listener in self.listeners:
            listener(event)

    def _recorded(self, key: bytes) -> bytes | None:
        recorded = self._known.get(key)
        if recorded is not None:
            self._again.add(key)
        return recorded

    @property
    def dropped(self) -> int:
        """Bytes of a half-written last event that an earlier process left."""
        return self._events.dropped

    def not_again(self) -> Iterator[Event]:
        """Events of an earlier process that have not happened again so far; they stay recorded."""
        for event in read_events(self.path) if self._known else ():
            key = _hash(event.kind, event.label)
            if key in self._known and key not in self._again:
                yield event

    def save_machine(self, digest: str, text: str) -> None:
        """Keep a machine once, by content hash."""
        path = self.path / MACHINES / f"{digest}.json"
        if not path.exists():
            self._keep(path, text + "\n")

    def finish(self, result: Mapping[str, Any]) -> None:
        """Write result.json; from then on the run is complete."""
        self._keep(self.path / RESULT, json.dumps(result, indent=1) + "\n")

    def close(self) -> None:
        """Give the run free for other processes."""
        self._events.close()
        self._held.close()

    def discard(self) -> None:
        """Remove a run that never got an answer from its model."""
        self.close()
        _remove(self.path, self._made)

    def _keep(self, path: Path, text: str) -> None:
        try:
            _write(path, text)
        except OSError as error:
            raise _full(path, error) from None


def _remove(path: Path | None, made: Sequence[Path]) -> None:
    """Remove a run, and those of the folders made for it that hold nothing else."""
    if path is not None:
        shutil.rmtree(path)
    for folder in made:
        with contextlib.suppress(OSError):  # never made, or another run has come to lie there
            folder.rmdir()


def _hash(*content: object) -> bytes:
    """Equal for what is equal as JSON data, whatever the order of its keys."""
    text = json.dumps(json.loads(json.dumps(content)), sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).digest()


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
    held = (path / NAME).open("r", encoding="utf-8")
    for _ in range(TRIES):
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(PAUSE)
        except OSError as error:
            held.close()
            raise RunError(f"cannot lock {path / NAME}: {error.strerror}") from None
        else:
            return held
    held.close()
    raise RunError(f"{path} is in use by another process; wait for it or stop it")


def _write(path: Path, text: str) -> None:
    """Write a whole file or nothing: a killed process leaves no half file under the final name."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def _full(path: Path, error: OSError) -> RunError:
    return RunError(f"cannot write {path}: {error.strerror}")
