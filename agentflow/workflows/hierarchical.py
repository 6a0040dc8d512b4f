"""The hierarchical workflow: plan, build by structure, criticise, refine, search."""

import asyncio
import math
from collections import defaultdict
from dataclasses import replace

from agentflow.agents.designer import Designer, Drafter
from agentflow.agents.meta_designer import Blueprint, MetaDesigner, MetaDesignerInput
from agentflow.runs.events import BlueprintEvent
from agentflow.runs.locations import INITIAL, Location
from agentflow.search.strategies import pooled, searches_whole_run
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.iterative import ITERATIVE
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.construction import build
from agentflow.workflows.stages.designs import design_machine, failure_reason
from agentflow.workflows.stages.pooled import search_all
from agentflow.workflows.stages.refinement import count_calls, design_and_refine, refine

STRUCTURES = 4
"""Structures of a typical blueprint, for cost estimates."""


async def hierarchical(run: WorkflowContext) -> WorkflowResult:
    """A plan, designs of its structures, criticism, then refinement with simulations.

    With the meta-designer off, designers build whole machines; a start machine needs neither.
    """
    run.begin_stage(INITIAL)
    if _builds_whole_machines(run.settings):
        return await design_and_refine(run)
    blueprint, reason = await _plan(run)
    if blueprint is None:
        candidates = [Candidate(t, reason=reason) for t in run.trajectories]
        return await refine(run, candidates, None)
    if (strategy := pooled(run.settings.search)) is not None:
        plans = _Plans(run, blueprint)
        return await search_all(run, strategy, plans.build, plans.of)
    return await refine(run, await build(run, blueprint), blueprint)


class _Plans:
    """The blueprints of a search over the whole run, which begins more trajectories than others.

    One of `STRUCTURES` trajectories follows a plan: it takes about as many calls as the other ones
    together, whose machines one designer each makes whole. The meta-designer plans anew after as
    many trajectories as the settings say, so that the run does not depend on one plan; asked for
    another mechanism, it splits the task anew for a trajectory.
    """

    def __init__(self, run: WorkflowContext, first: Blueprint) -> None:
        self._run, self._first = run, first
        self._made = {1: first}
        """By the first trajectory that follows it."""
        self._asking: dict[int, asyncio.Lock] = defaultdict(asyncio.Lock)

    def of(self, trajectory: int) -> Blueprint | None:
        """The blueprint that the first machine of a trajectory followed; None for a whole one."""
        return None if self._is_whole(trajectory) else self._made[self._key(trajectory)]

    async def build(self, trajectory: int) -> Candidate:
        """The first machine of a trajectory."""
        if self._is_whole(trajectory):
            return await design_machine(self._run, trajectory)
        key = self._key(trajectory)
        async with self._asking[key]:
            if key not in self._made:
                again, _ = await _plan(self._run, key)
                self._made[key] = again or self._first
        (candidate,) = await build(self._run, self._made[key], only=trajectory)
        return candidate

    def _is_whole(self, trajectory: int) -> bool:
        asked = self._run.memory.for_trajectory(trajectory).avoid
        return not asked and (trajectory - 1) % STRUCTURES > 0

    def _key(self, trajectory: int) -> int:
        if self._run.memory.for_trajectory(trajectory).avoid:
            return trajectory
        return trajectory - (trajectory - 1) % self._run.settings.trajectories


async def _plan(run: WorkflowContext, trajectory: int = 0) -> tuple[Blueprint | None, str]:
    """The blueprint of the run, or another one for a trajectory; or why there is none."""
    detailed = run.settings.meta_designer == "detailed"
    given = MetaDesignerInput(run.brief, detailed, await run.elsewhere(trajectory))
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
    each = STRUCTURES * settings.candidates
    calls = count_calls(settings, each)
    if not searches_whole_run(settings.search):
        return {MetaDesigner.name: 1, **calls}
    begun = calls[Designer.name] // each
    planned = math.ceil(begun / STRUCTURES)
    designs = planned * each + begun - planned
    first = {role: designs for role in (Designer.name, Drafter.name) if role in calls}
    plans = math.ceil(begun / max(STRUCTURES, settings.trajectories))
    return {MetaDesigner.name: plans, **calls, **first}


HIERARCHICAL = replace(ITERATIVE, name="hierarchical", stages=hierarchical, calls=_calls)
