"""Owns the placement workflows: many independent attempts to complete what a task gives.

No attempt learns of another and none is refined; the result counts how many do what is asked.
"""

from __future__ import annotations

from agentflow.agents.placer import Placer, PlacerInput
from agentflow.errors import UsageError
from agentflow.machine.edits.random import random_machine
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, FirstAttempt, StageName, WorkflowResult
from agentflow.workflows.context import Bench
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.shared import failure_of, first_of, tried

STAGE: StageName = "initial"
MOST_PLACED = 10
"""Most blocks that a random placement adds; chosen: half as many again as the longest way needs."""


async def placement(bench: Bench) -> WorkflowResult:
    """`settings.placements` placers, one call each; what is valid is simulated.

    Placers use the designer's model and sampling.
    """
    bench.begin(STAGE)

    async def place(attempt: int) -> Candidate:
        label = f"placer/traj-{attempt}"
        outcome = await bench.ask(
            Placer(), PlacerInput(bench.brief), label, stage=STAGE, model_role="designer", once=True
        )
        first = first_of(outcome)
        if outcome is None or outcome.output is None:
            return Candidate(attempt, first=first, reason=failure_of(outcome))
        return Candidate(attempt, outcome.output.machine, first=first)

    placed = await run_concurrently(place(attempt) for attempt in _attempts(bench))
    bench.end(STAGE, await tried(bench, STAGE, placed))
    return bench.result()


async def random_placement(bench: Bench) -> WorkflowResult:
    """The baseline: blocks of allowed types on random free faces, 1 to 10 of them; all are valid.

    No model is asked.
    """
    bench.begin(STAGE)
    brief = bench.brief
    size = len(brief.given) + 1, len(brief.given) + MOST_PLACED
    placed = []
    for attempt in _attempts(bench):
        try:
            machine = random_machine(bench.stream(f"traj-{attempt}"), brief, size)
        except UsageError as error:
            placed.append(Candidate(attempt, reason=str(error)))
        else:
            placed.append(Candidate(attempt, machine, first=FirstAttempt(True, True, True)))
    bench.end(STAGE, await tried(bench, STAGE, placed))
    return bench.result()


def _attempts(bench: Bench) -> range:
    return range(1, bench.settings.trajectories + 1)


def one_each(settings: WorkflowSettings) -> WorkflowSettings:
    """With a trajectory per placement."""
    return settings.model_copy(update={"trajectories": settings.placements})
