"""A workflow: designers, a name for each machine, then refinement as in `iterative`."""

from __future__ import annotations

from agentflow.runs.locations import INITIAL, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import design_machines
from agentflow.workflows.stages.refinement import count_calls, count_rollouts, refine
from agentflow.workflows.workflow import Workflow
from straight.role import Namer, NamerInput


async def named(run: WorkflowContext) -> WorkflowResult:
    """Design whole machines, name each, refine each."""

    async def give_name(candidate: Candidate) -> None:
        if candidate.machine is not None:
            given = NamerInput(**run.role_input, machine=candidate.machine)
            location = Location(Namer.name, trajectory=candidate.trajectory)
            await run.ask(Namer(), given, location, stage=INITIAL)

    run.begin_stage(INITIAL)
    designed = await design_machines(run)
    await run_concurrently(give_name(candidate) for candidate in designed)
    return await refine(run, designed, None)


def calls(settings: WorkflowSettings) -> dict[str, int]:
    """How many calls of each role to expect."""
    return {**count_calls(settings), Namer.name: settings.trajectories}


NAMED = Workflow("named", named, calls, count_rollouts, searches=True)
