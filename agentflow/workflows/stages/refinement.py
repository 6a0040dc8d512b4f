"""The stages after the first machines in the iterative and hierarchical workflows."""

import math
from collections.abc import Sequence
from functools import partial

from agentflow.agents.analyst import Analyst
from agentflow.agents.inspector import Inspector
from agentflow.agents.meta_designer import Blueprint
from agentflow.agents.querier import Querier
from agentflow.agents.refiner import Refiner
from agentflow.runs.locations import BLIND, FEEDBACK, INITIAL
from agentflow.search.concurrency import run_concurrently
from agentflow.search.pooled.halving import BEGUN
from agentflow.search.strategies import pooled, searches_whole_run
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import (
    count_designs,
    design_machine,
    design_machines,
    refine_blindly,
    try_machines,
)
from agentflow.workflows.stages.feedback import feedback_loop
from agentflow.workflows.stages.pooled import search_all


async def design_and_refine(run: WorkflowContext) -> WorkflowResult:
    """Designers make whole machines, which are refined, or searched all together."""
    strategy = pooled(run.settings.search)
    if strategy is not None:
        return await search_all(run, strategy, partial(design_machine, run))
    return await refine(run, await design_machines(run), None)


async def refine(
    run: WorkflowContext, designed: Sequence[Candidate], blueprint: Blueprint | None
) -> WorkflowResult:
    """Simulate the designed machines, refine each blindly, then run the feedback loop on it.

    Trajectories do not wait for each other: one may search while the first machine of another is
    being simulated. What a trajectory does depends only on its own answers and on the budget.
    A start machine is not refined blindly: the feedback loop begins with it. A machine with the
    greatest possible score is not refined at all.
    """
    over = run.spent is not None
    initial: list[Candidate] = []
    blind: list[Candidate] = []

    def close() -> None:
        """Close the stages that are complete."""
        if len(initial) < len(designed):
            return
        if not run.has_ended(INITIAL):
            run.end_stage(INITIAL, initial)
        whole = blind and len(blind) == sum(candidate.valid for candidate in initial)
        if whole and not run.has_ended(BLIND):
            run.end_stage(BLIND, blind)

    async def follow(design: Candidate) -> Candidate | None:
        (candidate,) = await try_machines(run, INITIAL, [design])
        initial.append(candidate)
        close()
        if over or not candidate.valid:
            return None
        better = candidate
        if not run.settings.start and run.left_in(candidate.trajectory):
            run.begin_stage(BLIND)
            if not candidate.perfect:
                better = await refine_blindly(run, candidate, blueprint)
            blind.append(better)
            close()
        if not better.valid or not run.settings.search.rounds:
            return None
        if not run.left_in(candidate.trajectory):
            return None
        run.begin_stage(FEEDBACK)
        return await feedback_loop(run, better, blueprint)

    jobs = run.memory.in_step((design.trajectory, follow(design)) for design in designed)
    searched = await run_concurrently(jobs)
    found = [candidate for candidate in searched if candidate is not None]
    if found:
        run.end_stage(FEEDBACK, found)
    return run.result()


def count_calls(settings: WorkflowSettings, designs: int = 1) -> dict[str, int]:
    """Role -> calls of a run without retries; `designs` is the designer calls per trajectory."""
    if searches_whole_run(settings.search):
        return _count_pooled_calls(settings, designs)
    many, search, blind = settings.trajectories, settings.search, not settings.start
    return {
        **count_designs(settings, designs),
        Inspector.name: many * settings.inspector * blind,
        Querier.name: many * search.rounds * settings.asks_querier,
        Refiner.name: many * (blind + search.rounds * search.children),
        **count_analyses(settings, search.rounds),
    }


def _count_pooled_calls(settings: WorkflowSettings, designs: int) -> dict[str, int]:
    """Those of a search over the whole run, as if half of its machines, and at most as many as
    `halving` begins with, were first designs and everybody made as many of the others: nobody knows
    before what it will choose."""
    total, arms = count_rollouts(settings), settings.arms
    begun = 1 if settings.start else min(total // 2, BEGUN) if arms else total
    each = len(arms) + settings.local_trials  # machines made while a refiner makes one
    refined = (total - begun) // each if Refiner.name in arms else 0
    first = settings.model_copy(update={"trajectories": begun})
    return {
        **count_designs(first, designs),
        Querier.name: refined * settings.asks_querier,
        Refiner.name: refined,
        **count_analyses(settings, math.ceil((total - begun) / settings.trajectories)),
    }


def count_analyses(settings: WorkflowSettings, rounds: int) -> dict[str, int]:
    """Those of analysts in so many rounds: after each but the last."""
    return {Analyst.name: max(0, rounds - 1)} if settings.asks_analyst else {}


def count_tried(settings: WorkflowSettings) -> int:
    """Machines that get all trials of the task: first and blindly refined ones."""
    return settings.trajectories * (1 if settings.start else 2)


def count_rollouts(settings: WorkflowSettings) -> int:
    """Simulations of a run that designs and refines, if no two machines are equal."""
    search = settings.search
    first = 1 if settings.start else 2
    each = search.children + settings.local_trials
    most = settings.trajectories * (first + search.rounds * each)
    limit = settings.max_simulations or most
    return limit if searches_whole_run(settings.search) else min(most, limit)


def within_limit(settings: WorkflowSettings) -> WorkflowSettings:
    """At most as many trajectories as simulations; a search over the whole run has a limit."""
    total = settings.max_simulations
    if searches_whole_run(settings.search):
        return settings.model_copy(update={"max_simulations": total or count_rollouts(settings)})
    many = min(settings.trajectories, total or settings.trajectories)
    return settings.model_copy(update={"trajectories": many})
