"""Owns the iterative workflow: whole machines, criticised, refined blindly, then by search."""

from __future__ import annotations

from agentflow.machine.brief import Brief
from agentflow.workflows.base import Desks, Laboratory, Record, WorkflowResult
from agentflow.workflows.bench import Bench
from agentflow.workflows.refinement import refined
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages import whole_machines


async def iterative(
    brief: Brief,
    desks: Desks,
    laboratory: Laboratory,
    settings: WorkflowSettings,
    record: Record,
    seed: int = 0,
) -> WorkflowResult:
    """Designer, inspector, blind refinement, feedback loop. Arguments as for a `Workflow`."""
    bench = Bench("iterative", brief, desks, laboratory, settings, record, seed)
    bench.begin("initial")
    return await refined(bench, await whole_machines(bench), None)
