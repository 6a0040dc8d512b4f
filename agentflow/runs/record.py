"""Totals of a run's events, for metrics, reports and displays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from agentflow.runs.events import (
    ArchiveEvent,
    AttemptEvent,
    CandidateEvent,
    EditEvent,
    EvaluationEvent,
    ExpandEvent,
    FilesEvent,
    NicheEvent,
    NodeEvent,
    ProgramEvent,
    RemarkEvent,
    RunEvent,
    RunStartEvent,
    StageBeginEvent,
    StageEvent,
    VerificationEvent,
)
from agentflow.runs.reading import Event


@dataclass
class RunRecord:
    """A run so far."""

    start: RunStartEvent | None = None
    stage: StageBeginEvent | None = None
    """The last stage to begin."""
    calls: int = 0
    """Answered model calls."""
    valid_calls: int = 0
    tokens: int = 0
    """As reported by the endpoint; 0 if it reports none."""
    evaluations: int = 0
    machines: dict[str, EvaluationEvent] = field(default_factory=dict)
    """Content hash of each simulated machine -> its last evaluation."""
    best: float | None = None
    """Highest score of a valid machine."""
    steps: int = 0
    """Expansions of search trees, or random edits."""
    refinements: list[AttemptEvent] = field(default_factory=list)
    """Accepted replies that hold an edited machine."""
    edits: list[EditEvent] = field(default_factory=list)
    """Random edits."""
    candidates: list[CandidateEvent] = field(default_factory=list)
    expansions: list[ExpandEvent] = field(default_factory=list)
    nodes: list[NodeEvent] = field(default_factory=list)
    archives: list[ArchiveEvent | NicheEvent] = field(default_factory=list)
    """The archives that searches began, and what was offered to them."""
    stages: list[StageEvent] = field(default_factory=list)
    verification: VerificationEvent | None = None
    """Of the best machine."""
    remarks: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, events: Iterable[RunEvent | Event]) -> RunRecord:
        """Add up the events of a run, which must be typed: see `read_typed_events`."""
        record = cls()
        for event in events:
            record.add(event)
        return record

    def add(self, event: RunEvent | Event) -> None:
        """Take in one event; TypeError if it is of a known kind and not typed."""
        if isinstance(event, Event) and event.kind in RunEvent.kinds:
            raise TypeError(
                f"an untyped event of the kind {event.kind!r} adds up to nothing: read events with "
                "read_typed_events, or agentflow.load(run).events"
            )
        if isinstance(event, AttemptEvent):
            self.calls += 1
            self.valid_calls += event.valid
            self.tokens += event.tokens
            if event.script is not None and event.machine is not None:
                self.refinements.append(event)
        elif isinstance(event, EvaluationEvent):
            self._add_evaluation(event)
        elif isinstance(event, CandidateEvent):
            self.candidates.append(event)
        elif isinstance(event, ExpandEvent):
            self.steps += 1
            self.expansions.append(event)
        elif isinstance(event, NodeEvent):
            self.nodes.append(event)
        elif isinstance(event, ArchiveEvent | NicheEvent):
            self.archives.append(event)
        elif isinstance(event, EditEvent):
            self.steps += 1
            self.edits.append(event)
        elif isinstance(event, StageEvent):
            self.stages.append(event)
        elif isinstance(event, StageBeginEvent):
            self.stage = event
        elif isinstance(event, RunStartEvent):
            self.start = event
        elif isinstance(event, VerificationEvent):
            self.verification = event
        elif isinstance(event, RemarkEvent):
            self.remarks.append(event.text)
        elif isinstance(event, ProgramEvent) and (event.status or event.timed_out):
            self.remarks.append(f"{event.label}: {event}; log.txt has its output")
        elif isinstance(event, FilesEvent) and str(event):
            self.remarks.append(f"{event.label}: {event}")

    def of_stage(self, name: str) -> list[CandidateEvent]:
        """The candidates of one stage, by trajectory."""
        return [item for item in self.candidates if item.location.name == name]

    def _add_evaluation(self, event: EvaluationEvent) -> None:
        self.evaluations += 1
        self.machines[event.machine] = event
        if event.valid and event.score is not None:
            self.best = event.score if self.best is None else max(self.best, event.score)
