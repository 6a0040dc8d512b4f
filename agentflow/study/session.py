"""The file of a session: what a person did while designing a machine, as JSON lines.

A session is a folder with the file `session.jsonl`. Its first line is a `SessionStart`; each other
line is an event, in the order of writing. A last line that was only half written is dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from functools import cached_property
from itertools import chain, repeat
from pathlib import Path
from time import monotonic
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AwareDatetime, BaseModel, Field, TypeAdapter

from agentflow.errors import RunError, UsageError
from agentflow.files.lines import LineFile, read_lines
from agentflow.machine import Machine, library, read_machine
from agentflow.machine.tree import MachineJson

FILE = "session.jsonl"
IDLE = 5.0
"""Seconds without an action or a trial that make a pause; chosen."""
ACTION_TIME = 1.0
"""Seconds that an action is taken to last, as only its moment is known; chosen."""

Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Written = Annotated[MachineJson, Field(min_length=1, max_length=1000)]
"""A machine as `Machine.to_json` writes it."""
Operation = Literal[
    "add", "remove", "move", "turn", "copy", "mirror", "control", "undo", "redo", "open", "new",
    "refine", "watch", "ask",
]  # fmt: skip
"""What an action does. `control` changes what controls the machine, `open` takes the machine of a
file, a trial or a run, `refine` asks a model for one. `watch` looks at a trial and `ask` looks
something up; both leave the machine as it is."""


class _Line(BaseModel, frozen=True, extra="forbid"):
    """One line of the file."""


class SessionStart(_Line):
    """The first line: what the person was asked to do.

    `limit_s` is a time limit, None for none; a `guided` session shows a rationale. `participant` is
    the code of the person in the study, never a name; "" outside of studies. `consent` is the text
    that the person agreed to before the start; "" if none was shown. `refine` says whether the
    person may hand the machine to a model.
    """

    kind: Literal["session"] = "session"
    format: Literal[1] = 1
    task: str = Field(max_length=80)
    limit_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    mode: Literal["free", "guided"] = "free"
    rationale: str = Field("", max_length=20_000)
    participant: str = Field("", pattern=r"^[A-Za-z0-9_-]{0,40}$")
    consent: str = Field("", max_length=20_000)
    refine: bool = True
    machine: Written
    began: AwareDatetime = Field(default_factory=lambda: datetime.now(timezone.utc))


class _Event(_Line):
    at: Seconds
    """When it began, seconds since the start of the session."""

    @property
    def end(self) -> float:
        """When it ended, seconds since the start."""
        return self.at


class Action(_Event):
    """The person did something to the machine, or looked at something."""

    kind: Literal["action"] = "action"
    do: Operation
    block: int | None = None
    type: int | None = None
    machine: Written
    """The whole machine after the action."""

    @property
    def end(self) -> float:
        return self.at + ACTION_TIME


class _Span(_Event):
    seconds: Seconds

    @property
    def end(self) -> float:
        return self.at + self.seconds


class StudioTest(_Span):
    """The machine was simulated; the line is written when the result is there.

    The score is None if the simulation crashed or timed out; `run` is the name of the run that
    holds the record.
    """

    kind: Literal["trial"] = "trial"
    machine: Written
    score: Annotated[float, Field(allow_inf_nan=False)] | None
    status: Literal["ok", "invalid", "diverged", "timeout", "crashed"]
    run: str = Field("", max_length=400)


class Pause(_Span):
    """Nothing was done. `SessionLog` writes these lines, except those that were asked for."""

    kind: Literal["pause"] = "pause"
    asked: bool = False
    """Whether the person stopped the clock: this is not time at work."""


class Note(_Event):
    """The person wrote something down."""

    kind: Literal["note"] = "note"
    text: str = Field(min_length=1, max_length=10_000)


class Audio(_Event):
    """The microphone was switched on."""

    kind: Literal["audio"] = "audio"
    file: str = Field(pattern=r"^[A-Za-z0-9_-]+\.[a-z0-9]+$", max_length=80)
    """Name of the file in the folder of the session."""


class End(_Event):
    """The last line; without it, the session was cut off."""

    kind: Literal["end"] = "end"
    reason: Literal["finished", "time", "left"]
    """The person finished, the time was up, or the studio was closed."""


Event = Action | StudioTest | Pause | Note | Audio | End
_EVENTS: TypeAdapter[Event] = TypeAdapter(Annotated[Event, Field(discriminator="kind")])
_Kind = TypeVar("_Kind", bound=_Event)


@dataclass(frozen=True)
class Session:
    """A recorded session."""

    path: Path
    start: SessionStart
    events: tuple[Event, ...]
    """In the order of time."""

    def of(self, kind: type[_Kind]) -> tuple[_Kind, ...]:
        """The events of one kind."""
        return tuple(event for event in self.events if isinstance(event, kind))

    @property
    def seconds(self) -> float:
        """Length of the session, with its pauses."""
        ended = next((event.at for event in self.of(End)), None)
        return max((event.end for event in self.events), default=0.0) if ended is None else ended

    @cached_property
    def machines(self) -> Mapping[str, Machine]:
        """Content hash -> machine, for every machine that was ever there."""
        lines: list[SessionStart | Action | StudioTest] = [
            self.start,
            *self.of(Action),
            *self.of(StudioTest),
        ]
        return {machine.digest: machine for machine in (self.machine(line) for line in lines)}

    def machine(self, line: SessionStart | Action | StudioTest) -> Machine:
        """The machine of a line.

        Raises:
            RunError: It is not a machine.
        """
        read = read_machine(line.machine, tuple(library()))
        if read.machine is None:
            at = getattr(line, "at", 0.0)
            problem = f"the machine at {at:.1f} s: {read.problems[0].message}"
            raise RunError(f"{self.path / FILE} is damaged: {problem}")
        return read.machine


class SessionLog:
    """Writes a session while it takes place."""

    def __init__(self, path: Path, clock: Callable[[], float] = monotonic) -> None:
        """Open the file; `begin` also writes its first line."""
        self.path = path
        self._lines = LineFile(path / FILE)
        self._clock, self._zero = clock, clock()
        self._busy = 0.0
        self._finished = False

    @classmethod
    def begin(
        cls, path: Path, start: SessionStart, clock: Callable[[], float] = monotonic
    ) -> SessionLog:
        """Begin a session in a folder, which is created if it is missing.

        Args:
            path: The folder.
            start: The first line.
            clock: Seconds since any moment.

        Raises:
            UsageError: The folder holds a session, or cannot be written.
        """
        try:
            path.mkdir(parents=True, exist_ok=True)
            (path / FILE).touch(exist_ok=False)
            log = cls(path, clock)
            log._write(start)
        except FileExistsError:
            raise UsageError(f"{path} holds a session already; name another folder") from None
        except OSError as error:
            raise UsageError(f"cannot write {path / FILE}: {error.strerror}") from None
        return log

    @property
    def now(self) -> float:
        """Seconds since the start, to the millisecond."""
        return round(self._clock() - self._zero, 3)

    def append(self, event: Action | StudioTest | Pause | Note | Audio | End) -> None:
        """Write an event, after the pause before it if there was one.

        Raises:
            UsageError: The session is over.
        """
        if self._finished:
            raise UsageError("this session is over; start another one")
        if not isinstance(event, Note | Audio):
            if event.at - self._busy >= IDLE:
                self._write(Pause(at=self._busy, seconds=round(event.at - self._busy, 3)))
            self._busy = max(self._busy, event.end)
        self._write(event)

    def finish(self, reason: Literal["finished", "time", "left"]) -> None:
        """Write the end and close the file; a second call does nothing."""
        if not self._finished:
            self.append(End(at=self.now, reason=reason))
            self._finished = True
            self._lines.close()

    def _write(self, line: SessionStart | Event) -> None:
        self._lines.append(line.model_dump_json(exclude_none=False).encode())


def read_session(path: Path) -> Session:
    """Read a session.

    Args:
        path: Its folder, or the file in it.

    Raises:
        RunError: There is none, or it is damaged; the message names file and line.
    """
    folder = path.parent if path.name == FILE else path
    file = folder / FILE
    if not file.is_file() or file.is_symlink():
        raise RunError(f"{folder} is not a session: it has no {FILE}")
    kinds: Iterator[TypeAdapter[Any]] = chain((TypeAdapter(SessionStart),), repeat(_EVENTS))
    lines = list(read_lines(file, lambda line: next(kinds).validate_json(line)))
    if not lines:
        raise RunError(f"{file} is empty; a session begins with a line of kind session")
    start, *events = lines
    return Session(folder, start, tuple(sorted(events, key=lambda event: event.at)))
