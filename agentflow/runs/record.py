"""Totals of a run's events, for metrics, reports and displays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from agentflow.runs import events as kinds
from agentflow.runs.reading import Event


@dataclass
class RunRecord:
    """A run so far.

    `stage` is the last stage to begin. `calls` are answered model calls, and `tokens` as reported
    by the endpoint, 0 if it reports none. `machines` maps the content hash of each simulated
    machine to its last evaluation, and `best` is the highest score of a valid one. `steps` are
    expansions of search trees, or random edits; `refinements` are accepted replies that hold an
    edited machine; `archives` are those that searches began, and what was offered to them;
    `verification` is that of the best machine.
    """

    start: kinds.RunStartEvent | None = None
    stage: kinds.StageBeginEvent | None = None
    calls: int = 0
    valid_calls: int = 0
    tokens: int = 0
    evaluations: int = 0
    machines: dict[str, kinds.EvaluationEvent] = field(default_factory=dict)
    best: float | None = None
    steps: int = 0
    refinements: list[kinds.AttemptEvent] = field(default_factory=list)
    edits: list[kinds.EditEvent] = field(default_factory=list)
    candidates: list[kinds.CandidateEvent] = field(default_factory=list)
    expansions: list[kinds.ExpandEvent] = field(default_factory=list)
    nodes: list[kinds.NodeEvent] = field(default_factory=list)
    archives: list[kinds.ArchiveEvent | kinds.NicheEvent] = field(default_factory=list)
    stages: list[kinds.StageEvent] = field(default_factory=list)
    verification: kinds.VerificationEvent | None = None
    remarks: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, events: Iterable[kinds.RunEvent | Event]) -> RunRecord:
        """Add up the events of a run, which must be typed: see `read_typed_events`."""
        record = cls()
        for event in events:
            record.add(event)
        return record

    def add(self, event: kinds.RunEvent | Event) -> None:
        """Take in one event; TypeError if it is of a known kind and not typed."""
        if isinstance(event, Event) and event.kind in kinds.RunEvent.kinds:
            raise TypeError(
                f"an untyped event of the kind {event.kind!r} adds up to nothing: read events with "
                "read_typed_events, or agentflow.load(run).events"
            )
        if isinstance(event, kinds.AttemptEvent):
            self.calls += 1
            self.valid_calls += event.valid
            self.tokens += event.tokens
            if event.script is not None and event.machine is not None:
                self.refinements.append(event)
        elif isinstance(event, kinds.EvaluationEvent):
            self.evaluations += 1
            self.machines[event.machine] = event
            if event.valid and event.score is not None:
                self.best = event.score if self.best is None else max(self.best, event.score)
        elif isinstance(event, kinds.CandidateEvent):
            self.candidates.append(event)
        elif isinstance(event, kinds.ExpandEvent):
            self.steps += 1
            self.expansions.append(event)
        elif isinstance(event, kinds.NodeEvent):
            self.nodes.append(event)
        elif isinstance(event, kinds.ArchiveEvent | kinds.NicheEvent):
            self.archives.append(event)
        elif isinstance(event, kinds.EditEvent):
            self.steps += 1
            self.edits.append(event)
        elif isinstance(event, kinds.StageEvent):
            self.stages.append(event)
        elif isinstance(event, kinds.StageBeginEvent):
            self.stage = event
        elif isinstance(event, kinds.RunStartEvent):
            self.start = event
        elif isinstance(event, kinds.VerificationEvent):
            self.verification = event
        elif isinstance(event, kinds.RemarkEvent):
            self.remarks.append(event.text)
        elif isinstance(event, kinds.ProgramEvent) and (event.status or event.timed_out):
            self.remarks.append(f"{event.label}: {event}; log.txt has its output")
        elif isinstance(event, kinds.FilesEvent) and str(event):
            self.remarks.append(f"{event.label}: {event}")

    def of_stage(self, name: str) -> list[kinds.CandidateEvent]:
        """The candidates of one stage, by trajectory."""
        return [item for item in self.candidates if item.location.name == name]
