"""Records the one session that is open, in a folder below that of the runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from secrets import token_hex
from time import monotonic
from typing import Annotated, Any, BinaryIO, Literal

from pydantic import Field, TypeAdapter, ValidationError

from agentflow.errors import AgentflowError, UsageError
from agentflow.files.faults import tell_fault
from agentflow.machine import library, read_machine
from agentflow.machine.tree import MachineJson
from agentflow.study.session import (
    FILE,
    Action,
    Audio,
    Note,
    Pause,
    Session,
    SessionLog,
    SessionStart,
    StudioTest,
    read_session,
)

FOLDER = "sessions"
"""Name of the folder of sessions below the directory of runs."""
MOST_EVENTS = 20_000
"""Most lines of one session."""
MOST_SOUND = 512 * 2**20
"""Most bytes of one recording; an hour of speech has about 60 MB."""
Told = Action | StudioTest | Note
"""What the page reports; this process writes everything else."""
_TOLD: TypeAdapter[Told] = TypeAdapter(Annotated[Told, Field(discriminator="kind")])


@dataclass
class _Open:
    """The session that is open."""

    name: str
    start: SessionStart
    log: SessionLog
    machine: MachineJson
    """As it was last told."""
    events: int = 0
    paused_at: float | None = None
    """When the person stopped the clock; None while it runs."""
    paused: float = 0.0
    """Seconds for which it was stopped before."""
    sound: BinaryIO | None = None
    sounds: int = 0
    written: int = 0
    """Bytes of sound."""

    @property
    def left(self) -> float | None:
        """Seconds until the time limit; None without one."""
        limit, now = self.start.limit_s, self.paused_at
        if limit is None:
            return None
        return limit + self.paused - (self.log.now if now is None else now)

    def go_on(self) -> None:
        """Let the clock run again, and record how long it stood."""
        if self.paused_at is not None:
            seconds = round(self.log.now - self.paused_at, 3)
            self.log.append(Pause(at=self.paused_at, seconds=seconds, asked=True))
            self.paused, self.paused_at = self.paused + seconds, None


class SessionRecorder:
    """Writes sessions, one at a time; leaving the context ends the one that is open."""

    def __init__(self, runs: Path, clock: Callable[[], float] = monotonic) -> None:
        """`runs` is the directory of the runs; `clock` gives seconds since any moment."""
        self._folder, self._clock = runs / FOLDER, clock
        self._open: _Open | None = None

    def begin(self, start: SessionStart) -> dict[str, Any]:
        """Begin a session.

        Raises:
            UsageError: One is open already, or its folder cannot be written.
        """
        if self._current() is not None:
            raise UsageError("a session is open in this studio; end it before you start another")
        if self._folder.is_symlink():
            raise UsageError(f"{self._folder} is a link; sessions must be in a plain folder")
        task = re.sub(r"[^A-Za-z0-9_-]", "-", start.task)
        name = f"{datetime.now():%Y%m%d-%H%M%S}-{task}-{token_hex(2)}"
        log = SessionLog.begin(self._folder / name, start, self._clock)
        self._open = _Open(name, start, log, start.machine)
        return self._describe(self._open)

    def current(self) -> dict[str, Any] | None:
        """The session that is open, if any: its start, the time left and its machine."""
        found = self._current()
        return None if found is None else self._describe(found)

    def tell(self, name: str, event: Mapping[str, Any]) -> float | None:
        """Add what the page says that has happened; the seconds that are left.

        Args:
            name: Name of the session.
            event: A `Told` without `at`: it ends now, by the clock of this process.

        Raises:
            UsageError: The session is not open any more, or there is no such event.
        """
        found = self._named(name)
        seconds, length, timed = event.get("seconds"), 0.0, {}
        if isinstance(seconds, int | float) and seconds >= 0:
            length = min(seconds, found.log.now)  # before any float: it may have 400 digits
            timed = {"seconds": round(length, 3)}
        at = round(found.log.now - length, 3)
        try:
            read = _TOLD.validate_python({**event, **timed, "at": max(at, 0.0)})
        except ValidationError as error:
            raise UsageError(tell_fault(error, "the event")) from None
        if isinstance(read, Action | StudioTest):
            _require_machine(read.machine)
            found.machine = read.machine
        if found.events >= MOST_EVENTS:
            raise UsageError(f"a session has at most {MOST_EVENTS} events; end it")
        found.events += 1
        found.log.append(read)
        return found.left

    def pause(self, name: str, paused: bool) -> float | None:
        """Stop the clock, or let it run again; the seconds that are left.

        Raises:
            UsageError: The session is not open any more.
        """
        found = self._named(name)
        if not paused:
            found.go_on()
        elif found.paused_at is None:
            found.paused_at = found.log.now
        return found.left

    def hear(self, name: str, sound: bytes, first: bool) -> None:
        """Add sound of the microphone; the first piece begins a new recording.

        Raises:
            UsageError: The session is not open any more, or the sound is too long.
        """
        found = self._named(name)
        found.written += len(sound)
        if found.written > MOST_SOUND:
            raise UsageError("the recording of this session is too long; switch the microphone off")
        if first or found.sound is None:
            found.sounds += 1
            file = f"speech-{found.sounds}.webm"
            self._silence(found)
            found.sound = (found.log.path / file).open("xb")
            found.log.append(Audio(at=found.log.now, file=file))
        found.sound.write(sound)

    def end(self, name: str) -> None:
        """End a session that its person has finished.

        Raises:
            UsageError: It is not open any more.
        """
        self._close(self._named(name), "finished")

    def sessions(self) -> Iterator[dict[str, Any]]:
        """Every session, the newest first, in a few numbers; damaged ones with their problem."""
        if self._folder.is_symlink() or not self._folder.is_dir():
            return
        for path in sorted(self._folder.iterdir(), reverse=True):
            if not path.is_symlink() and (path / FILE).is_file():
                try:
                    yield {"session": path.name, "problem": "", **_numbers(read_session(path))}
                except AgentflowError as error:
                    yield {"session": path.name, "problem": str(error)}

    def read(self, name: str) -> Session:
        """A session by name, finished or not.

        Raises:
            UsageError: It is not the name of one.
            RunError: It is damaged.
        """
        path = self._folder / name
        plain = re.fullmatch(r"[A-Za-z0-9_-]+", name) and not self._folder.is_symlink()
        if not plain or path.is_symlink() or not (path / FILE).is_file():
            raise UsageError(f"there is no session {name[:80]!r}; name one from the list")
        return read_session(path)

    def _current(self) -> _Open | None:
        """The session that is open, unless its time is up."""
        found = self._open
        if found is not None and found.left is not None and found.left <= 0:
            self._close(found, "time")
        return self._open

    def _named(self, name: str) -> _Open:
        found = self._current()
        if found is None or found.name != name:
            raise UsageError("this session is over: its time is up, or it was ended")
        return found

    def _close(self, found: _Open, reason: Literal["finished", "time", "left"]) -> None:
        self._silence(found)
        found.go_on()
        found.log.finish(reason)
        self._open = None

    @staticmethod
    def _silence(found: _Open) -> None:
        if found.sound is not None:
            found.sound.close()

    @staticmethod
    def _describe(found: _Open) -> dict[str, Any]:
        start = found.start.model_dump(include={"task", "mode", "rationale", "refine"})
        told = {"left_s": found.left, "paused": found.paused_at is not None}
        return {"session": found.name, **start, **told, "machine": found.machine}

    def __enter__(self) -> SessionRecorder:
        return self

    def __exit__(self, *_: object) -> None:
        if (found := self._current()) is not None:
            self._close(found, "left")


def _require_machine(machine: MachineJson) -> None:
    report = read_machine(machine, tuple(library()))
    if report.machine is None:
        raise UsageError(report.problems[0].message)


def _numbers(session: Session) -> dict[str, Any]:
    scores = [trial.score for trial in session.of(StudioTest) if trial.score is not None]
    return {
        "task": session.start.task,
        "mode": session.start.mode,
        "participant": session.start.participant,
        "began": session.start.began.timestamp(),
        "seconds": session.seconds,
        "actions": len(session.of(Action)),
        "trials": len(session.of(StudioTest)),
        "best": max(scores, default=None),
    }
