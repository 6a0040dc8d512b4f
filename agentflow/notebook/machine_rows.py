"""What a run has made, one row per machine, and its best score against what was spent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

from agentflow.errors import UnknownNameError
from agentflow.notebook.words import By
from agentflow.report.lineage import Lineage, LineageNode
from agentflow.runs import Event
from agentflow.runs.events import AttemptEvent, EvaluationEvent, NodeEvent, RunEvent
from agentflow.runs.locations import Location
from agentflow.runs.record import RunRecord

COLUMNS = (
    *("run", "seed", "stage", "trajectory", "round", "node", "parent", "machine", "score"),
    *("verified", "validity", "problem", "simulations", "calls", "tokens", "seconds"),
)
"""Columns of the rows of a run; those of sweeps begin with the axes."""


class CurvePoint(NamedTuple):
    """The best score of a run when it had spent so much."""

    spent: float
    """Simulations, calls, tokens or seconds."""
    best: float
    """Highest score of a valid machine so far."""


@dataclass(frozen=True)
class Spent:
    """What a run had spent at some moment."""

    simulations: int = 0
    calls: int = 0
    tokens: int = 0
    seconds: float = 0.0


def require_by(by: str) -> By:
    """One of the things that a run spends; UnknownNameError if it is another word."""
    for known in get_args(By):
        if by == known:
            found: By = known
            return found
    raise UnknownNameError("cost", by, get_args(By))


def curve(events: Iterable[RunEvent | Event], by: By = "simulations") -> tuple[CurvePoint, ...]:
    """The best score so far, after each machine that got a score, against what was spent.

    A machine that is tried again does not count as another simulation.
    """
    record, seen = RunRecord(), set[str]()
    points: list[CurvePoint] = []
    for event in events:
        record.add(event)
        if isinstance(event, EvaluationEvent):
            seen |= {event.machine} if event.valid else set()
            if record.best is not None:
                spent = getattr(_spent(record, len(seen), event.at), by)
                points.append(CurvePoint(spent, record.best))
    return tuple(points)


def machine_rows(events: Sequence[RunEvent | Event], run: str, seed: int) -> list[dict[str, Any]]:
    """One row for each machine of a run, also for those that were refused; see `COLUMNS`.

    Spent is what the run had spent when the machine was simulated, or when its call was answered.
    """
    spent, rounds = _moments(events)
    record = RunRecord.of(events)
    return [
        _row(node, spent, rounds, record) | {"run": run, "seed": seed}
        for node in Lineage.of(events).finish(None)
    ]


def _row(
    node: LineageNode,
    moments: Mapping[str | None, Spent],
    rounds: Mapping[str, int],
    record: RunRecord,
) -> dict[str, Any]:
    place, check = Location.parse(node.id), record.verification
    spent = next(
        (moments[key] for key in (node.machine, *node.calls[::-1]) if key in moments), None
    )
    validity = "valid" if node.valid else node.kind if node.machine is None else "invalid"
    verified = check.score if check is not None and check.machine == node.machine else None
    return {
        **dict.fromkeys(COLUMNS),
        "stage": place.name,
        "trajectory": place.trajectory,
        "round": rounds.get(node.id, place.round),
        "node": node.id,
        "parent": node.parent,
        "machine": node.machine,
        "score": node.score,
        "verified": verified,
        "validity": validity,
        "problem": node.problem,
        **(vars(spent) if spent is not None else {}),
    }


def _moments(
    events: Iterable[RunEvent | Event],
) -> tuple[dict[str | None, Spent], dict[str, int]]:
    """Machine or call -> what was spent by then; node of a search -> its round."""
    record, seen = RunRecord(), set[str]()
    moments: dict[str | None, Spent] = {}
    rounds: dict[str, int] = {}
    for event in events:
        record.add(event)
        if isinstance(event, EvaluationEvent):
            seen |= {event.machine} if event.valid else set()
            moments.setdefault(event.machine, _spent(record, len(seen), event.at))
        elif isinstance(event, AttemptEvent):
            moments[event.label] = _spent(record, len(seen), event.at)
        elif isinstance(event, NodeEvent):
            rounds[event.label] = event.round
    return moments, rounds


def _spent(record: RunRecord, simulations: int, seconds: float) -> Spent:
    return Spent(simulations, record.calls, record.tokens, seconds)
