"""Owns the iterative workflow: whole machines, criticised, refined blindly, then by search."""

from __future__ import annotations

from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import Bench
from agentflow.workflows.stages.refinement import refined
from agentflow.workflows.stages.shared import whole_machines


async def iterative(bench: Bench) -> WorkflowResult:
    """Designer, inspector, blind refinement, feedback loop."""
    bench.begin("initial")
    return await refined(bench, await whole_machines(bench), None)
