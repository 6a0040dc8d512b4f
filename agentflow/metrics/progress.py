"""The curve of a run: best score over calls, tokens, expansions and time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from agentflow.runs import Event
from agentflow.runs.events import EvaluationEvent, RunEvent
from agentflow.runs.record import RunRecord


@dataclass(frozen=True)
class ProgressPoint:
    """The state of a run after one evaluation."""

    evaluations: int
    expansions: int
    """Expansions of search trees, or random edits."""
    calls: int
    tokens: int
    """As reported by the endpoint; 0 where it reports none."""
    seconds: float
    """Seconds of work into the run."""
    score: float | None
    """Score of this evaluation; None if the simulation crashed or timed out."""
    best: float | None
    """Best score so far."""


def progress(events: Iterable[RunEvent | Event]) -> Iterator[ProgressPoint]:
    """One point per evaluation, in order."""
    run = RunRecord()
    for event in events:
        run.add(event)
        if isinstance(event, EvaluationEvent):
            counts = (run.evaluations, run.steps, run.calls, run.tokens)
            yield ProgressPoint(*counts, event.at, event.score, run.best)
