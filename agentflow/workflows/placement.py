"""Owns the placement workflows: many independent attempts to complete what a task gives.

No attempt learns of another and none is refined; the result counts how many do what is asked.
"""

from __future__ import annotations

from agentflow.agents.placer import Placer, PlacerInput
from agentflow.errors import UsageError
from agentflow.machine.brief import Brief
from agentflow.machine.random import random_machine
from agentflow.search.concurrency import together
from agentflow.workflows.base import (
    Candidate,
    Desks,
    First,
    Laboratory,
    Record,
    StageName,
    WorkflowResult,
)
from agentflow.workflows.bench import Bench
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages import failure_of, first_of, tried

STAGE: StageName = "initial"
MOST_PLACED = 10
"""Most blocks that a random placement adds; chosen: half as many again as the longest way needs."""


async def placement(
    brief: Brief,
    desks: Desks,
    laboratory: Laboratory,
    settings: WorkflowSettings,
    record: Record,
    seed: int = 0,
) -> WorkflowResult:
    """`settings.placements` placers, one call each; what is valid is simulated.

    Placers sit at the designer's desk: its model, its sampling.

    Arguments as for a `Workflow`.
    """
    bench = _bench("placement", brief, desks, laboratory, settings, record, seed)

    async def place(attempt: int) -> Candidate:
        label = f"placer/traj-{attempt}"
        outcome = await bench.ask(
            Placer(), PlacerInput(brief), label, stage=STAGE, desk="designer", once=True
        )
        first = first_of(outcome)
        if outcome is None or outcome.output is None:
            return Candidate(attempt, first=first, reason=failure_of(outcome))
        return Candidate(attempt, outcome.output.machine, first=first)

    placed = await together(place(attempt) for attempt in _attempts(settings))
    bench.end(STAGE, await tried(bench, STAGE, placed))
    return bench.result()


async def random_placement(
    brief: Brief,
    desks: Desks,
    laboratory: Laboratory,
    settings: WorkflowSettings,
    record: Record,
    seed: int = 0,
) -> WorkflowResult:
    """The baseline: blocks of allowed types on random free faces, 1 to 10 of them; all are valid.

    Arguments as for a `Workflow`; no model is asked.
    """
    bench = _bench("random-placement", brief, desks, laboratory, settings, record, seed)
    size = len(brief.given) + 1, len(brief.given) + MOST_PLACED
    placed = []
    for attempt in _attempts(settings):
        try:
            machine = random_machine(bench.stream(f"traj-{attempt}"), brief, size)
        except UsageError as error:
            placed.append(Candidate(attempt, reason=str(error)))
        else:
            placed.append(Candidate(attempt, machine, first=First(True, True, True)))
    bench.end(STAGE, await tried(bench, STAGE, placed))
    return bench.result()


def _attempts(settings: WorkflowSettings) -> range:
    return range(1, settings.placements + 1)


def _bench(
    name: str,
    brief: Brief,
    desks: Desks,
    laboratory: Laboratory,
    settings: WorkflowSettings,
    record: Record,
    seed: int,
) -> Bench:
    """A bench with one trajectory per attempt, whose only stage has begun."""
    counted = settings.model_copy(update={"trajectories": settings.placements})
    bench = Bench(name, brief, desks, laboratory, counted, record, seed)
    bench.begin(STAGE)
    return bench
