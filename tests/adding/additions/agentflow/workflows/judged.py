"""Whole machines, refined by search, each judged at the end."""

from __future__ import annotations

from agentflow.agents.judge import Judge, JudgeInput

from agentflow.agents.designer import Designer
from agentflow.agents.refiner import Refiner
from agentflow.runs.events import JudgementEvent
from agentflow.runs.locations import FEEDBACK, INITIAL, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import design_machines, simulate
from agentflow.workflows.stages.feedback import feedback_loop
from agentflow.workflows.workflow import Workflow


async def judged(run: WorkflowContext) -> WorkflowResult:
    """Designer, feedback loop, judge."""

    async def follow(candidate: Candidate) -> Candidate:
        found = await feedback_loop(run, candidate, None)
        assert found.machine is not None
        location = Location(Judge.name, trajectory=candidate.trajectory)
        given = JudgeInput(run.brief, found.machine)
        outcome = await run.ask(Judge(), given, location, stage=FEEDBACK)
        run.note(JudgementEvent(location, outcome.output if outcome and outcome.output else ""))
        return found

    run.begin_stage(INITIAL)
    initial = run.end_stage(INITIAL, await simulate(run, INITIAL, await design_machines(run)))
    if not run.is_over(initial):
        run.begin_stage(FEEDBACK)
        refined = await run_concurrently(follow(candidate) for candidate in initial.survivors)
        run.end_stage(FEEDBACK, refined)
    return run.result()


def _calls(settings: WorkflowSettings) -> dict[str, int]:
    many = settings.trajectories
    return {Designer.name: many, Refiner.name: many * settings.search.rounds, Judge.name: many}


JUDGED = Workflow("judged", judged, _calls, rollouts=lambda settings: 2 * settings.trajectories)
