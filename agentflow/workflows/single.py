"""Owns the single-agent workflow: whole machines, revised by the same agent."""

from __future__ import annotations

from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import Bench
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.feedback import STAGE, feedback_loop
from agentflow.workflows.stages.shared import INITIAL, tried, whole_machines


async def single(bench: Bench) -> WorkflowResult:
    """One designer per candidate; then each revises its machine, `search.rounds` times.

    A revision is a refinement of the last machine with the designer's model and sampling,
    told the default feedback: no inspector, and the settings are `chained`. With 0 rounds there is
    no feedback.
    """
    bench.begin(INITIAL)
    initial = bench.end(INITIAL, await tried(bench, INITIAL, await whole_machines(bench)))
    if not bench.over(initial) and bench.settings.search.rounds:
        bench.begin(STAGE)
        revised = (
            feedback_loop(bench, candidate, None, model_role="designer")
            for candidate in initial.survivors
        )
        bench.end(STAGE, await run_concurrently(revised))
    return bench.result()


def chained(settings: WorkflowSettings) -> WorkflowSettings:
    """Without a querier, and with the strategy `random`, which is a plain chain."""
    chain = settings.search.model_copy(update={"strategy": "random"})
    return settings.model_copy(update={"querier": False, "search": chain})
