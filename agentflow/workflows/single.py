"""The single-agent workflow: whole machines, revised by the same agent."""

from agentflow.agents.designer import Designer
from agentflow.agents.refiner import Refiner
from agentflow.runs.locations import FEEDBACK, INITIAL
from agentflow.search.concurrency import run_concurrently
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.random_dsl import RANDOM_DSL
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.stages.designs import count_designs, design_machines, try_machines
from agentflow.workflows.stages.feedback import feedback_loop
from agentflow.workflows.stages.refinement import count_analyses, within_limit
from agentflow.workflows.workflow import Workflow


async def single(run: WorkflowContext) -> WorkflowResult:
    """One designer per candidate, which then revises its machine in every search round.

    A revision refines the last machine, with the designer's model and sampling and the default
    feedback. There is no inspector. With 0 rounds there is no feedback.
    """
    run.begin_stage(INITIAL)
    designed = await design_machines(run)
    initial = run.end_stage(
        INITIAL, await try_machines(run, INITIAL, designed, model_role=Designer.name)
    )
    if not run.is_over(initial) and run.settings.search.rounds:
        run.begin_stage(FEEDBACK)
        revised = (
            (candidate.trajectory, feedback_loop(run, candidate, None, model_role=Designer.name))
            for candidate in initial.survivors
        )
        run.end_stage(FEEDBACK, await run_concurrently(run.memory.in_step(revised)))
    return run.result()


def _adapt(settings: WorkflowSettings) -> WorkflowSettings:
    """Without a querier; every strategy gives way to `random`, which refines the last machine."""
    search = settings.search.model_copy(update={"strategy": "random"})
    adapted = settings.model_copy(update={"querier": False, "search": search})
    return within_limit(adapted)


def _calls(settings: WorkflowSettings) -> dict[str, int]:
    revised = settings.trajectories * settings.search.rounds
    analysed = count_analyses(settings, settings.search.rounds)
    return {**count_designs(settings), Refiner.name: revised, **analysed}


def _rollouts(settings: WorkflowSettings) -> int:
    most = settings.trajectories * (1 + settings.search.rounds * (1 + settings.local_trials))
    return min(most, settings.max_simulations or most)


SINGLE = Workflow(
    "single",
    single,
    _calls,
    _rollouts,
    tried=lambda settings: settings.trajectories,
    adapt=_adapt,
    baseline=RANDOM_DSL.name,
    searches=True,
)
