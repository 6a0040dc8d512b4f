"""Typed events of a run, one class per kind. Events of unknown kinds stay plain `Event`s."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from agentflow.errors import DamagedError
from agentflow.files.lines import damaged_line, read_new_lines
from agentflow.holding import Holding
from agentflow.runs.locations import Location
from agentflow.runs.reading import EVENTS, Event, parse_event, read_events


@dataclass(frozen=True)
class RunEvent:
    """One thing that happened in a run. Fields are the event's data, except location and time."""

    kind: ClassVar[str]
    needs: ClassVar[tuple[str, ...]]
    """Numbered parts that the location must have."""
    optional: ClassVar[tuple[str, ...]]
    """Fields left out of the data when None."""
    kinds: ClassVar[dict[str, type[RunEvent]]] = {}

    location: Location
    at: float = field(default=0.0, compare=False, kw_only=True)
    """Seconds of work into the run."""

    def __init_subclass__(
        cls, kind: str, needs: tuple[str, ...] = (), optional: tuple[str, ...] = ()
    ) -> None:
        known = cls.kinds.get(kind, cls)
        if (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
            owner = f"{known.__module__}.{known.__qualname__}"
            raise ValueError(f"the event kind {kind!r} is already used by {owner}")
        cls.kind, cls.needs, cls.optional = kind, needs, optional
        cls.kinds[kind] = cls

    @property
    def label(self) -> str:
        return str(self.location)

    @property
    def data(self) -> dict[str, Any]:
        """The recorded data: JSON values."""
        found = {key: _plain(value) for key, value in vars(self).items()}
        omitted = {name for name in self.optional if found[name] is None}
        return {key: found[key] for key in found if key not in {"location", "at", *omitted}}


@dataclass(frozen=True)
class FirstAttempt:
    """How far the first attempt got, before any retry.

    `parsed`: its reply had the required format; `spatial`: its machine was also spatially valid;
    `valid`: it was also accepted.
    """

    parsed: bool = False
    spatial: bool = False
    valid: bool = False

    def __and__(self, other: FirstAttempt) -> FirstAttempt:
        """How far both got, for designs that build on each other."""
        both = zip(vars(self).values(), vars(other).values(), strict=True)
        return FirstAttempt(*map(all, both))


FLAWLESS = FirstAttempt(parsed=True, spatial=True, valid=True)


@dataclass(frozen=True)
class RunStartEvent(RunEvent, kind="run"):
    """The run began; at "start"."""

    task: str
    workflow: str
    model: str


@dataclass(frozen=True)
class StageBeginEvent(RunEvent, kind="stage_begin"):
    """A stage began; the location names it."""

    trajectories: int


@dataclass(frozen=True)
class AttemptEvent(RunEvent, kind="attempt", optional=("machine", "script")):
    """A model call was answered; the location is that of the call."""

    role: str
    valid: bool
    parsed: bool
    spatial: bool | None
    repaired: bool
    code: str
    problem: str
    tokens: int
    machine: str | None = None
    """Content hash of the machine in the reply."""
    script: str | None = None
    """The edits of a refinement."""


@dataclass(frozen=True)
class BlueprintEvent(RunEvent, kind="blueprint"):
    """A blueprint was accepted; its fields are those of the models' notation."""

    definition: str
    function_points: Sequence[Any]
    design_structure: Sequence[Any]
    build_order: Sequence[Any]
    machine_structure: Mapping[str, Any]


@dataclass(frozen=True)
class BeamEvent(RunEvent, kind="beam", needs=("structure",)):
    """A structure was added to every machine of the beam."""

    machines: tuple[str | None, ...]
    """Content hashes."""


@dataclass(frozen=True)
class RefillEvent(RunEvent, kind="refill", needs=("structure",)):
    """Empty places of the beam were filled with copies of other machines.

    `sources` are the trajectories that the machines come from.
    """

    sources: tuple[int, ...]


@dataclass(frozen=True)
class ConstructionEndEvent(RunEvent, kind="construction_end", needs=("structure",)):
    """Construction stopped early because no trajectory got a valid design."""

    reason: str


@dataclass(frozen=True)
class EvaluationEvent(
    RunEvent, kind="evaluation", needs=("trajectory",), optional=("robust", "success", "met")
):
    """A machine was simulated, or its earlier result reused.

    The score is None when the simulation crashed or timed out. `broken` has (block, partner,
    seconds) of each broken connection, `rollout` is a hash of every recorded state, and `moved` the
    largest displacement of any block, m. `robust` is the robust score, if searches compare it;
    `success` says whether the task's criterion of success is met, where the score alone does not
    say; `met` says how many requirements are met, of how many, and is None without any.
    """

    machine: str
    valid: bool
    score: float | None
    status: str
    broken: tuple[tuple[int, int, float], ...]
    rollout: str | None
    moved: float | None = None
    robust: float | None = None
    success: bool | None = None
    met: tuple[int, int] | None = None


@dataclass(frozen=True)
class InspectionEvent(RunEvent, kind="inspection"):
    """An inspector's report."""

    machine: str
    world_score: float | None
    world: Any
    defects: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class CandidateEvent(RunEvent, kind="candidate", needs=("trajectory",)):
    """The machine of one trajectory at the end of a stage.

    `valid` says whether there is a machine that could be simulated, after all retries; `reason` why
    it is invalid, else it is empty.
    """

    trajectory: int
    machine: str | None
    valid: bool
    score: float | None
    first: FirstAttempt
    reason: str


@dataclass(frozen=True)
class StageEvent(RunEvent, kind="stage", optional=("tools",)):
    """A stage ended: its row of the stage table; see `workflows.statistics.stage_row`."""

    name: str
    trajectories: int
    parsed_first: int
    spatial_first: int
    valid_first: int
    valid: int
    mean: float | None
    mean_all: float | None
    max: float | None
    std: float | None
    calls: int
    tokens: int
    rollouts: int
    expansions: int
    attempts: int
    children: int
    tools: Mapping[str, Mapping[str, int]] | None = None
    """Tool -> `calls`, and how many of them were `refused`; None if no tools were called."""


@dataclass(frozen=True)
class SelectEvent(RunEvent, kind="select", needs=("trajectory", "round")):
    """A search selected a node."""

    path: tuple[int, ...]
    """Node ids from the root."""


@dataclass(frozen=True)
class QueryEvent(RunEvent, kind="query"):
    """A querier's queries were answered."""

    machine: str
    queries: Sequence[Any]
    answer: str


@dataclass(frozen=True)
class ToolEvent(RunEvent, kind="tool", needs=("call",), optional=("machine",)):
    """An agent called a tool; the location is the stage and the number of the call in it.

    The name of the tool is `unknown` if there is no such tool. Its arguments are as the agent sent
    them and, like the answer, cut to a sane length. `code` is the kind of the first problem of a
    refused machine or edit, as in `AttemptEvent`; `machine` is the content hash of the machine that
    the call was about, or that it made.
    """

    tool: str
    arguments: Any
    refused: bool
    answer: str
    code: str = ""
    machine: str | None = None


@dataclass(frozen=True)
class ProgramEvent(RunEvent, kind="program"):
    """The program that worked at a stage has ended.

    `status` is its exit status, or the negative number of the signal that killed it. `timed_out`
    says whether it was stopped at its time limit, and `isolated` whether it could read nothing but
    its folder; None in runs of old versions.
    """

    status: int
    timed_out: bool
    isolated: bool | None = None

    def __str__(self) -> str:
        told = "was stopped at its limit" if self.timed_out else "ended"
        how = {True: " (isolated)", False: " (not isolated)", None: ""}[self.isolated]
        return f"the program {told} with status {self.status}{how}"


@dataclass(frozen=True)
class FileVerdict:
    """What became of a file that a program left.

    `machine` is its name, None if there is none that is valid; `problem` says why it does not
    count, and is empty if it does.
    """

    file: str
    machine: str | None
    problem: str


@dataclass(frozen=True)
class FilesEvent(RunEvent, kind="files"):
    """The machine files that a program left at the end of a stage were judged.

    `more` files were not looked at. `problem` says why there are none, if their folder cannot be
    read; else it is empty.
    """

    files: tuple[FileVerdict, ...]
    more: int
    problem: str

    def __str__(self) -> str:
        """How many files do not count, and why the first does not; "" if all count."""
        if self.problem:
            return f"the folder machines cannot be read: {self.problem}"
        refused = [f"machines/{item.file}: {item.problem}" for item in self.files if item.problem]
        count = len(refused) + self.more
        if not count:
            return ""
        number = "1 file does" if count == 1 else f"{count} files do"
        first = f", such as {refused[0]}" if refused else ": others came first"
        return f"{number} not count{first}"


@dataclass(frozen=True)
class ExpandAttempt:
    """One attempt of an expansion; `label` is relative to the search."""

    label: str
    valid: bool
    note: str


@dataclass(frozen=True)
class ExpandEvent(RunEvent, kind="expand", needs=("trajectory", "round")):
    """A search expanded a node.

    `children` are the ids of the new nodes. `fallback` says whether no attempt was valid, so the
    only child has the parent's machine.
    """

    node: int
    attempts: tuple[ExpandAttempt, ...]
    children: tuple[int, ...]
    fallback: bool

    @property
    def valid(self) -> int:
        """Number of valid attempts; each gave a new machine."""
        return sum(attempt.valid for attempt in self.attempts)


@dataclass(frozen=True)
class NodeEvent(RunEvent, kind="node", needs=("trajectory", "node")):
    """A new node of a search tree was evaluated. Ids count from 1; the root has no event."""

    round: int
    parent: int
    made_by: str
    """Label of the attempt, relative to the search."""
    machine: str
    valid: bool
    score: float | None


@dataclass(frozen=True)
class LocalTrial:
    """One edit of a machine, tried alone.

    `edit` are commands, with `; ` between them, or words for an edit that none repeat; `machine` is
    the content hash of what it made.
    """

    edit: str
    machine: str
    score: float | None


@dataclass(frozen=True)
class LocalTrialsEvent(RunEvent, kind="local_trials", needs=("trajectory", "node")):
    """Single edits of a machine were tried before its refiner was asked."""

    machine: str
    score: float | None
    trials: tuple[LocalTrial, ...]
    text: str
    """What the refiner reads of them."""


@dataclass(frozen=True)
class RememberedMachine:
    """The best machine of a trajectory.

    `mechanism` is the class of its mechanism.
    """

    trajectory: int
    machine: str
    score: float | None
    mechanism: str


@dataclass(frozen=True)
class RememberedMechanism:
    """The machines of one class."""

    mechanism: str
    count: int
    best: float
    """Best of what searches compare."""


@dataclass(frozen=True)
class MemoryEvent(RunEvent, kind="memory", needs=("round",)):
    """What trajectories see of each other from now on; the location counts these events."""

    best: tuple[RememberedMachine, ...]
    lessons: tuple[str, ...]
    """What edits did to the score, the most telling first; prompts have room for fewer."""
    mechanisms: tuple[RememberedMechanism, ...]


@dataclass(frozen=True)
class AnotherMechanismEvent(RunEvent, kind="another_mechanism", needs=("trajectory",)):
    """The first design of a trajectory is asked for another mechanism than those found."""

    mechanisms: tuple[str, ...]
    """Those to avoid, as designers read them."""


@dataclass(frozen=True)
class BackUpEvent(RunEvent, kind="back_up", needs=("trajectory", "node")):
    """A reward was added to every node of a path."""

    path: tuple[int, ...]
    reward: float


@dataclass(frozen=True)
class SearchEndEvent(RunEvent, kind="search", needs=("trajectory",), optional=("reason",)):
    """A search ended."""

    result: int
    best: int
    stopped: bool
    expansions: int
    attempts: int
    valid: int
    rollouts: int
    reason: str | None = None
    """`greatest score` if that ended it; None after its last round or at the budget."""


@dataclass(frozen=True)
class RecordedAxis:
    """One axis of an archive: its range is divided into cells of equal width."""

    name: str
    unit: str
    low: float
    high: float
    cells: int
    labels: tuple[str, ...]
    """Names of the cells, if they are categories; else empty."""


@dataclass(frozen=True)
class ArchiveEvent(RunEvent, kind="archive", needs=("trajectory",)):
    """A search began to keep the best machine of each kind."""

    axes: tuple[RecordedAxis, ...]


@dataclass(frozen=True)
class NicheEvent(RunEvent, kind="niche", needs=("trajectory", "node")):
    """A node was offered to the archive of its search; the root is node 0.

    `values` are on the axes, in their order, and `cell` is its number on each, from 0; None if it
    belongs to no cell. The outcome is `new` or `better` if it became the best of its cell, else
    `worse` or `unmeasured`. `mechanism` is the class of the mechanism; None if it is unknown.
    """

    round: int
    machine: str
    score: float | None
    values: tuple[float | None, ...]
    cell: tuple[int, ...] | None
    outcome: str
    mechanism: str | None

    @property
    def kept(self) -> bool:
        """Whether it became the best of its cell."""
        return self.outcome in ("new", "better")


@dataclass(frozen=True)
class EditEvent(RunEvent, kind="edit", needs=("trajectory", "round")):
    """A random edit was tried, and kept if it scored higher."""

    parent: str | None
    machine: str
    kept: bool


@dataclass(frozen=True)
class ResultEvent(
    RunEvent, kind="result", optional=("trajectory", "machine", "valid", "score", "first")
):
    """The workflow ended, with the highest score; of a search over the whole run, verification may
    choose another machine. The location names the workflow."""

    trajectory: int | None = None
    machine: str | None = None
    valid: bool | None = None
    score: float | None = None
    first: FirstAttempt | None = None
    reason: str = ""
    stage: str | None = None
    stopped: str | None = None


@dataclass(frozen=True)
class VariedScore:
    """The score of a machine under one variation of the simulation."""

    variation: str
    status: str
    score: float | None
    """None when the simulation crashed or timed out."""


@dataclass(frozen=True)
class VerificationEvent(RunEvent, kind="verification"):
    """The best machine, or at a location `finalist` another one that could have been chosen, was
    simulated under small variations of the conditions. That of the best machine comes last.

    Score (the median), low and high are None if any simulation crashed or timed out.

    The first of the `scores` is that under the default conditions.
    """

    machine: str
    score: float | None
    low: float | None
    high: float | None
    scores: tuple[VariedScore, ...]

    @property
    def holding(self) -> Holding | None:
        """In which simulations the score holds; None if any crashed or timed out."""
        return Holding.of_verified(self.data)


@dataclass(frozen=True)
class RemarkEvent(RunEvent, kind="remark"):
    """A notice for the user; the location is its number."""

    text: str


@dataclass(frozen=True)
class CallsEvent(RunEvent, kind="calls"):
    """A call began or ended; shown and not recorded."""

    under_way: int
    cost: float | None


@dataclass(frozen=True)
class DrawingEvent(RunEvent, kind="drawing"):
    """Pictures of the result are being made; shown and not recorded.

    `frames` are those of the film that are drawn, and all; (0, 0) while it has not begun.
    """

    frames: tuple[int, int] = (0, 0)
    location: Location = field(default_factory=lambda: Location("best"))


def typed_event(event: Event) -> RunEvent | Event:
    """The typed event, or the event itself if its kind is unknown; ValueError if it is damaged."""
    known = RunEvent.kinds.get(event.kind)
    if known is None:
        return event
    location = Location.parse(event.label)
    for part in known.needs:
        if not location.has(part):
            raise ValueError(f"the label of {event.kind} {event.label!r} has no {part}")
    from pydantic import ValidationError

    try:
        read: RunEvent = _adapter(event.kind).validate_python(
            {**event.data, "location": location, "at": event.at}
        )
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise ValueError(f"{event.kind} {event.label}: {where}: {first['msg']}") from None
    return read


def read_typed_events(path: Path) -> Iterator[RunEvent | Event]:
    """The recorded events in order, one at a time, typed if their kind is known."""
    for event in read_events(path):
        yield _typed(event, path)


def read_new_typed_events(path: Path, offset: int) -> tuple[list[RunEvent | Event], int]:
    """The events whose lines are complete beyond a byte offset, typed likewise, and the offset
    behind them.

    Events that replace earlier ones are among them, as they come.

    Raises:
        RunError: The file cannot be read, or a line is damaged.
    """
    events, now = read_new_lines(path / EVENTS, parse_event, offset)
    return [_typed(event, path) for event in events], now


def _typed(event: Event, path: Path) -> RunEvent | Event:
    try:
        return typed_event(event)
    except ValueError as error:
        if not event.line:  # read from the middle of the file
            raise DamagedError(f"{path / EVENTS} is damaged: {error}") from None
        raise damaged_line(path / EVENTS, event.line, error) from None


def read_stage(path: Path, stage: str) -> list[RunEvent]:
    """The recorded events of a stage, in order."""
    events = read_typed_events(path)
    return [e for e in events if isinstance(e, RunEvent) and e.location.name == stage]


def _plain(value: Any) -> Any:
    """A value as JSON data."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if is_dataclass(value):
        return {key: _plain(item) for key, item in vars(value).items()}
    return value


@cache
def _adapter(kind: str) -> Any:
    from pydantic import TypeAdapter

    return TypeAdapter(RunEvent.kinds[kind])
