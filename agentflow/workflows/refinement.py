"""Owns what follows the first machines in the iterative and the hierarchical workflow."""

from __future__ import annotations

from agentflow.agents.meta_designer import Blueprint
from agentflow.search.concurrency import together
from agentflow.workflows.base import Candidate, Stage, WorkflowResult
from agentflow.workflows.bench import Bench
from agentflow.workflows.feedback import STAGE, feedback_loop
from agentflow.workflows.stages import BLIND, refined_blindly


async def refined(bench: Bench, initial: Stage, blueprint: Blueprint | None) -> WorkflowResult:
    """Inspector and blind refinement, then the feedback loop; ends early with what there is.

    No trajectory waits for another: one may search while another is still refined blindly. What a
    trajectory does depends on its own answers alone, also on a spent budget.

    Args:
        bench: The run.
        initial: Its first stage, closed.
        blueprint: The plan that the machines were built to.
    """
    if bench.over(initial):
        return bench.result()
    bench.begin(BLIND)
    blind: list[Candidate] = []

    async def follow(candidate: Candidate) -> Candidate | None:
        better = await refined_blindly(bench, candidate, blueprint)
        blind.append(better)
        if len(blind) == len(initial.survivors):
            bench.end(BLIND, blind)
        if not better.valid or not bench.settings.search.rounds:
            return None
        bench.begin(STAGE)
        return await feedback_loop(bench, better, blueprint)

    searched = await together(follow(candidate) for candidate in initial.survivors)
    found = [candidate for candidate in searched if candidate is not None]
    if found:
        bench.end(STAGE, found)
    return bench.result()
