"""What a run has made, one row per machine, and its best score against what was spent."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from agentflow.notebook.words import By
from agentflow.report.lineage import Lineage, LineageNode
from agentflow.runs import Event
from agentflow.runs.events import AttemptEvent, EvaluationEvent, RunEvent, VerificationEvent
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


class Spent(NamedTuple):
    """What a run had spent at some moment."""

    simulations: int
    """A machine that is simulated again does not count again."""
    calls: int
    tokens: int
    seconds: float


def curve(events: Iterable[RunEvent | Event], by: By = "simulations") -> tuple[CurvePoint, ...]:
    """The best score so far, after each machine that was simulated, against what was spent."""
    return tuple(
        CurvePoint(getattr(spent, by), best)
        for event, best, spent in _spending(events)
        if isinstance(event, EvaluationEvent) and best is not None
    )


def machine_rows(events: Sequence[RunEvent | Event], run: str, seed: int) -> list[dict[str, Any]]:
    """One row for each machine of a run, also for those that were refused; see `COLUMNS`.

    Spent is what the run had spent when the machine was simulated, or when its call was answered.
    """
    moments: dict[str | None, Spent] = {}
    for event, _, spent in _spending(events):
        if isinstance(event, EvaluationEvent):
            moments.setdefault(event.machine, spent)
        else:
            moments[event.label] = spent
    record = RunRecord.of(events)
    rounds = {event.label: event.round for event in record.nodes}
    own = {**dict.fromkeys(COLUMNS), "run": run, "seed": seed}
    return [
        {**own, **_cells(node, moments, rounds, record.verification)}
        for node in Lineage.of(events).finish(None)
    ]


def _cells(
    node: LineageNode,
    moments: Mapping[str | None, Spent],
    rounds: Mapping[str, int],
    check: VerificationEvent | None,
) -> dict[str, Any]:
    place = Location.parse(node.id)
    known = (moments[key] for key in (node.machine, *node.calls[::-1]) if key in moments)
    spent = next(known, None)
    return {
        "stage": place.name,
        "trajectory": place.trajectory,
        "round": rounds.get(node.id, place.round),
        "node": node.id,
        "parent": node.parent,
        "machine": node.machine,
        "score": node.score,
        "verified": check.score if check and check.machine == node.machine else None,
        "validity": "valid" if node.valid else node.kind if node.machine is None else "invalid",
        "problem": node.problem,
        **(spent._asdict() if spent else {}),
    }


def _spending(
    events: Iterable[RunEvent | Event],
) -> Iterator[tuple[AttemptEvent | EvaluationEvent, float | None, Spent]]:
    """Each answered call and simulation, with the best score so far and what was spent by then."""
    record, simulated = RunRecord(), set[str]()
    for event in events:
        record.add(event)
        if isinstance(event, EvaluationEvent) and event.valid:
            simulated.add(event.machine)
        if isinstance(event, AttemptEvent | EvaluationEvent):
            spent = Spent(len(simulated), record.calls, record.tokens, event.at)
            yield event, record.best, spent
