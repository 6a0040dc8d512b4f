"""Owns the single-agent workflow: whole machines, revised by the same agent."""

from __future__ import annotations

from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.feedback import STAGE, feedback_loop
from agentflow.workflows.stages.shared import INITIAL, design_machines, simulate


async def single(run: WorkflowContext) -> WorkflowResult:
    """One designer per candidate; then each revises its machine, `search.rounds` times.

    A revision is a refinement of the last machine with the designer's model and sampling,
    told the default feedback: no inspector, and the settings are `chained`. With 0 rounds there is
    no feedback.
    """
    run.begin_stage(INITIAL)
    initial = run.end_stage(INITIAL, await simulate(run, INITIAL, await design_machines(run)))
    if not run.is_over(initial) and run.settings.search.rounds:
        run.begin_stage(STAGE)
        revised = (
            feedback_loop(run, candidate, None, model_role="designer")
            for candidate in initial.survivors
        )
        run.end_stage(STAGE, await run_concurrently(revised))
    return run.result()


def chained(settings: WorkflowSettings) -> WorkflowSettings:
    """Without a querier, and with the strategy `random`, which is a plain chain."""
    chain = settings.search.model_copy(update={"strategy": "random"})
    return settings.model_copy(update={"querier": False, "search": chain})
