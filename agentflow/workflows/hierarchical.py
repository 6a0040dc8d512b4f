"""The hierarchical workflow: plan, build by structure, criticise, refine, search."""

from __future__ import annotations

from dataclasses import replace

from agentflow.agents.meta_designer import Blueprint, MetaDesigner, MetaDesignerInput
from agentflow.runs.events import BlueprintEvent
from agentflow.runs.locations import INITIAL, Location
from agentflow.search.strategies import pooled
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.iterative import ITERATIVE
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.construction import build
from agentflow.workflows.stages.designs import failure_reason
from agentflow.workflows.stages.pooled import search_all
from agentflow.workflows.stages.refinement import count_calls, design_and_refine, refine

STRUCTURES = 4
"""Structures of a typical blueprint, for cost estimates."""


async def hierarchical(run: WorkflowContext) -> WorkflowResult:
    """Meta-designer, designers per structure, inspector, blind refinement, feedback loop.

    With the meta-designer off, designers build whole machines; a start machine needs neither.
    """
    run.begin_stage(INITIAL)
    if _builds_whole_machines(run.settings):
        return await design_and_refine(run)
    blueprint, reason = await _plan(run)
    if blueprint is None:
        candidates = [Candidate(t, reason=reason) for t in run.trajectories]
        return await refine(run, candidates, None)
    other: dict[int, Blueprint] = {}

    async def design(trajectory: int) -> Candidate:
        """Asked for another mechanism, the meta-designer splits the task anew."""
        if run.memory.for_trajectory(trajectory).avoid:
            again, _ = await _plan(run, trajectory)
            other[trajectory] = again or blueprint
        plan = other.get(trajectory, blueprint)
        (candidate,) = await build(run, plan, only=trajectory)
        return candidate

    if (strategy := pooled(run.settings.search)) is not None:
        return await search_all(run, strategy, design, lambda t: other.get(t, blueprint))
    return await refine(run, await build(run, blueprint), blueprint)


async def _plan(run: WorkflowContext, trajectory: int = 0) -> tuple[Blueprint | None, str]:
    """The blueprint of the run, or another one for a trajectory; or why there is none."""
    detailed = run.settings.meta_designer == "detailed"
    given = MetaDesignerInput(run.brief, detailed, run.memory.for_trajectory(trajectory))
    location = Location(MetaDesigner.name, trajectory=trajectory)
    outcome = await run.ask(MetaDesigner(), given, location, stage=INITIAL)
    if outcome is None or outcome.output is None:
        return None, f"no valid blueprint: {failure_reason(outcome)}"
    run.note(BlueprintEvent(location, **outcome.output.to_json()))
    return outcome.output, ""


def _builds_whole_machines(settings: WorkflowSettings) -> bool:
    return settings.meta_designer == "off" or bool(settings.start)


def _calls(settings: WorkflowSettings) -> dict[str, int]:
    if _builds_whole_machines(settings):
        return count_calls(settings)
    return {MetaDesigner.name: 1, **count_calls(settings, STRUCTURES * settings.candidates)}


HIERARCHICAL = replace(ITERATIVE, name="hierarchical", stages=hierarchical, calls=_calls)
