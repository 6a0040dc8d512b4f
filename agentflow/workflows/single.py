"""Owns the single-agent workflow: whole machines, revised by the same agent."""

from __future__ import annotations

from agentflow.machine.brief import Brief
from agentflow.search.concurrency import together
from agentflow.workflows.base import Desks, Laboratory, Record, WorkflowResult
from agentflow.workflows.bench import Bench
from agentflow.workflows.feedback import STAGE, feedback_loop
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages import INITIAL, tried, whole_machines


async def single(
    brief: Brief,
    desks: Desks,
    laboratory: Laboratory,
    settings: WorkflowSettings,
    record: Record,
    seed: int = 0,
) -> WorkflowResult:
    """One designer per candidate; then each revises its machine, `search.rounds` times.

    A revision is a refinement of the last machine at the designer's desk (its model and sampling),
    told the default feedback: no inspector, no querier, and the strategy is always `random`, which
    is a plain chain. With 0 rounds there is no feedback. Arguments as for a `Workflow`.
    """
    chain = settings.search.model_copy(update={"strategy": "random"})
    alone = settings.model_copy(update={"querier": False, "search": chain})
    bench = Bench("single", brief, desks, laboratory, alone, record, seed)
    bench.begin("initial")
    initial = bench.end(INITIAL, await tried(bench, INITIAL, await whole_machines(bench)))
    if not bench.over(initial) and chain.rounds:
        bench.begin(STAGE)
        revised = (
            feedback_loop(bench, candidate, None, desk="designer")
            for candidate in initial.survivors
        )
        bench.end(STAGE, await together(revised))
    return bench.result()
