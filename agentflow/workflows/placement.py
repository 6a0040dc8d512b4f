"""Owns the placement workflows: many independent attempts to complete what a task gives.

No attempt learns of another and none is refined; the result counts how many do what is asked.
"""

from __future__ import annotations

from agentflow.agents.placer import Placer, PlacerInput
from agentflow.errors import UsageError
from agentflow.machine.edits.random import random_machine
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, FirstAttempt, StageName, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.shared import failure_reason, first_attempt_of, simulate

STAGE: StageName = "initial"
MOST_PLACED = 10
"""Most blocks that a random placement adds; chosen: half as many again as the longest way needs."""


async def placement(run: WorkflowContext) -> WorkflowResult:
    """`settings.placements` placers, one call each; what is valid is simulated.

    Placers use the designer's model and sampling.
    """
    run.begin_stage(STAGE)

    async def place(attempt: int) -> Candidate:
        label = f"placer/traj-{attempt}"
        outcome = await run.ask(Placer(), PlacerInput(run.brief), label, stage=STAGE, once=True)
        first = first_attempt_of(outcome)
        if outcome is None or outcome.output is None:
            return Candidate(attempt, first=first, reason=failure_reason(outcome))
        return Candidate(attempt, outcome.output.machine, first=first)

    placed = await run_concurrently(place(attempt) for attempt in _attempts(run))
    run.end_stage(STAGE, await simulate(run, STAGE, placed))
    return run.result()


async def random_placement(run: WorkflowContext) -> WorkflowResult:
    """The baseline: blocks of allowed types on random free faces, 1 to 10 of them; all are valid.

    No model is asked.
    """
    run.begin_stage(STAGE)
    brief = run.brief
    size = len(brief.given) + 1, len(brief.given) + MOST_PLACED
    placed = []
    for attempt in _attempts(run):
        try:
            machine = random_machine(run.stream(f"traj-{attempt}"), brief, size)
        except UsageError as error:
            placed.append(Candidate(attempt, reason=str(error)))
        else:
            placed.append(Candidate(attempt, machine, first=FirstAttempt(True, True, True)))
    run.end_stage(STAGE, await simulate(run, STAGE, placed))
    return run.result()


def _attempts(run: WorkflowContext) -> range:
    return range(1, run.settings.trajectories + 1)


def one_each(settings: WorkflowSettings) -> WorkflowSettings:
    """With a trajectory per placement."""
    return settings.model_copy(update={"trajectories": settings.placements})
