"""The placement workflows: independent attempts to complete the structure that a task gives.

Nothing is refined; the result counts how many attempts succeed.
"""

from dataclasses import replace

from agentflow.agents.context import RoleInput
from agentflow.agents.designer import Placer
from agentflow.machine.brief import Brief
from agentflow.runs.locations import INITIAL, RANDOM_EDITS, Location
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import Candidate, WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import candidate_of, draw_machine, simulate
from agentflow.workflows.workflow import Workflow, completes_machines

MOST_PLACED = 10
"""Maximum number of blocks that a random placement adds: 1.5 times the longest solution."""


async def placement(run: WorkflowContext) -> WorkflowResult:
    """Several single replies, each of which places blocks; the valid machines are simulated."""
    run.begin_stage(INITIAL)
    brief = _brief(run)

    async def place(attempt: int) -> Candidate:
        asked, given = Location(Placer.name, trajectory=attempt), RoleInput(brief)
        outcome = await run.ask(Placer(), given, asked, stage=INITIAL, once=True)
        return candidate_of(attempt, outcome)

    placed = await run_concurrently(place(attempt) for attempt in run.trajectories)
    run.end_stage(INITIAL, await simulate(run, INITIAL, placed))
    return run.result()


async def random_placement(run: WorkflowContext) -> WorkflowResult:
    """Baseline without a model: 1 to 10 blocks of allowed types on random free faces."""
    run.begin_stage(INITIAL)
    brief = _brief(run)
    size = len(brief.given) + 1, len(brief.given) + MOST_PLACED
    placed = [
        draw_machine(attempt, run.stream(f"traj-{attempt}"), brief, size=size)
        for attempt in run.trajectories
    ]
    run.end_stage(INITIAL, await simulate(run, INITIAL, placed))
    return run.result()


def _brief(run: WorkflowContext) -> Brief:
    """The brief; a start machine takes the place of the given structure."""
    return replace(run.brief, given=run.settings.start_machine or run.brief.given)


def _adapt(settings: WorkflowSettings) -> WorkflowSettings:
    """One trajectory per placement; each simulates one machine."""
    many = min(settings.placements, settings.max_simulations or settings.placements)
    return settings.model_copy(update={"trajectories": many, "placements": many})


RANDOM_PLACEMENT = Workflow(
    "random-placement",
    random_placement,
    calls=lambda _: {},
    rollouts=lambda settings: settings.placements,
    fits=completes_machines,
    adapt=_adapt,
    author=lambda _: RANDOM_EDITS,
    counts_passes=True,
)
PLACEMENT = replace(
    RANDOM_PLACEMENT,
    name="placement",
    stages=placement,
    calls=lambda settings: {Placer.name: settings.placements},
    author=lambda _: "",
    baseline=RANDOM_PLACEMENT.name,
)
