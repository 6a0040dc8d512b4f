"""The workflow `explore`: search for the best machine of every kind with MAP-Elites."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from agentflow.errors import UsageError
from agentflow.machine.edits.random import random_machine
from agentflow.runs.events import FLAWLESS, FirstAttempt
from agentflow.runs.places import FEEDBACK, INITIAL, Place
from agentflow.search.concurrency import run_concurrently
from agentflow.search.elites.archive import Archive
from agentflow.search.elites.map_elites import map_elites
from agentflow.search.settings import MAP_ELITES
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.explore.emitters import Emitters
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.feedback import Version
from agentflow.workflows.stages.search_record import SearchRecorder
from agentflow.workflows.stages.shared import design_machines, simulate
from agentflow.workflows.workflow import RANDOM_EDITS, Workflow


async def explore(run: WorkflowContext) -> WorkflowResult:
    """One first machine per trajectory, then a search with an archive of its own from each.

    First machines are random, or made by designers if refiners make new machines. The trajectories
    share `settings.rollouts` evenly; reports merge their archives.
    """
    run.begin_stage(INITIAL)
    total = _rollouts(run.settings)
    numbers = list(run.trajectories)[:total]
    drawn = await design_machines(run) if _asks_models(run.settings) else _draw(run)
    initial = run.end_stage(INITIAL, await simulate(run, INITIAL, drawn[: len(numbers)]))
    left = total - initial.rollouts
    if run.is_over(initial) or left <= 0:
        return run.result()
    run.begin_stage(FEEDBACK)
    starts = initial.survivors
    shares = [left // len(starts) + (at < left % len(starts)) for at in range(len(starts))]
    searches = (_search(run, *item) for item in zip(starts, shares, strict=True))
    run.end_stage(FEEDBACK, await run_concurrently(searches))
    return run.result()


async def _search(run: WorkflowContext, start: Candidate, rollouts: int) -> Candidate:
    """Search from one machine; the result is the best of all its kinds."""
    assert start.machine is not None
    assert start.evaluation is not None
    archive = Archive[Version]([item.axis for item in start.evaluation.measurements])
    emitters = Emitters(run, start.trajectory, archive, rollouts)
    recorder = SearchRecorder(run, Place(FEEDBACK, trajectory=start.trajectory))
    found = await map_elites(
        Version(start.machine),
        replace(start.evaluation, perfect=False),
        emitters.expand,
        emitters.evaluate,
        run.settings.search,
        recorder,
        archive,
    )
    recorder.finish(found)
    best = found.nodes[found.best]
    asked = emitters.emitter_of("round-1/node-0/try-1") == "refiner"
    return Candidate(
        start.trajectory,
        best.candidate.machine,
        best.evaluation,
        first=emitters.refiners.first if asked else FLAWLESS,
        edit=best.candidate.edit,
        search_cost=found.cost,
    )


def _draw(run: WorkflowContext) -> list[Candidate]:
    """The start machine, or else a random one, for each trajectory."""

    def draw(trajectory: int) -> Candidate:
        rng = run.stream(f"traj-{trajectory}")
        try:
            machine = run.settings.start_machine or random_machine(rng, run.brief)
        except UsageError as error:
            return Candidate(trajectory, first=FirstAttempt(), reason=str(error))
        return Candidate(trajectory, machine, first=FLAWLESS)

    return [draw(trajectory) for trajectory in run.trajectories]


def _asks_models(settings: WorkflowSettings) -> bool:
    return "refiner" in settings.emitters


def _rollouts(settings: WorkflowSettings) -> int:
    search = settings.search
    return settings.rollouts or settings.trajectories * (1 + search.rounds * search.width)


def _adapt(settings: WorkflowSettings) -> WorkflowSettings:
    """The rollouts end the search, not its rounds: each makes one new machine at least, or none."""
    total = _rollouts(settings)
    search = settings.search.model_copy(update={"strategy": MAP_ELITES, "rounds": total})
    return settings.model_copy(update={"rollouts": total, "search": search})


def _calls(settings: WorkflowSettings) -> Mapping[str, int]:
    if not _asks_models(settings):
        return {}
    share = settings.emitters.count("refiner") / len(settings.emitters)
    edits = _rollouts(settings) - settings.trajectories
    calls = {
        "designer": settings.trajectories * (not settings.start),
        "refiner": round(share * edits),
    }
    queried = settings.asks_querier * round(share * edits / settings.search.width)
    return {**calls, "querier": queried}


EXPLORE = Workflow(
    "explore",
    explore,
    calls=_calls,
    rollouts=_rollouts,
    adapt=_adapt,
    author=lambda settings: "" if _asks_models(settings) else RANDOM_EDITS,
    has_rollout_limit=True,
)
