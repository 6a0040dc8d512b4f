"""Owns what follows the first machines in the iterative and the hierarchical workflow."""

from __future__ import annotations

from agentflow.agents.meta_designer import Blueprint
from agentflow.workflows.base import Stage, WorkflowResult
from agentflow.workflows.bench import Bench
from agentflow.workflows.feedback import feedback_loop
from agentflow.workflows.stages import refined_blindly


async def refined(bench: Bench, initial: Stage, blueprint: Blueprint | None) -> WorkflowResult:
    """Inspector and blind refinement, then the feedback loop; ends early with what there is.

    Args:
        bench: The run.
        initial: Its first stage, closed.
        blueprint: The plan that the machines were built to.
    """
    if bench.over(initial):
        return bench.result()
    bench.begin("blind_refinement")
    blind = bench.end(await refined_blindly(bench, initial.survivors, blueprint))
    if bench.over(blind) or not bench.settings.search.rounds:
        return bench.result()
    bench.begin("env_feedback")
    bench.end(await feedback_loop(bench, blind.survivors, blueprint))
    return bench.result()
