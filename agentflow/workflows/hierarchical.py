"""Owns the hierarchical workflow: plan, build by structure, criticise, refine, search."""

from __future__ import annotations

from agentflow.agents.meta_designer import Blueprint, MetaDesigner, MetaDesignerInput
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import Bench
from agentflow.workflows.stages.construction import build
from agentflow.workflows.stages.refinement import refined
from agentflow.workflows.stages.shared import failure_of, whole_machines


async def hierarchical(bench: Bench) -> WorkflowResult:
    """Meta-designer, designers per structure, inspector, blind refinement, feedback loop.

    With the meta-designer off, designers build whole machines.
    """
    settings = bench.settings
    bench.begin("initial")
    blueprint: Blueprint | None = None
    if settings.meta_designer == "off":
        candidates = await whole_machines(bench)
    else:
        blueprint, reason = await _plan(bench)
        candidates = (
            await build(bench, blueprint)
            if blueprint
            else [Candidate(t, reason=reason) for t in range(1, settings.trajectories + 1)]
        )
    return await refined(bench, candidates, blueprint)


async def _plan(bench: Bench) -> tuple[Blueprint | None, str]:
    """The blueprint, or why there is none."""
    given = MetaDesignerInput(bench.brief, detailed=bench.settings.meta_designer == "detailed")
    outcome = await bench.ask(MetaDesigner(), given, "meta_designer", stage="initial")
    if outcome is None or outcome.output is None:
        return None, f"no valid blueprint: {failure_of(outcome)}"
    bench.record.event("blueprint", "meta_designer", **outcome.output.to_json())
    return outcome.output, ""
