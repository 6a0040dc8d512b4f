"""The iterative workflow: whole machines, criticised, refined blindly, then by search."""

from agentflow.runs.locations import INITIAL
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.random_dsl import RANDOM_DSL
from agentflow.workflows.stages import refinement
from agentflow.workflows.workflow import Workflow


async def iterative(run: WorkflowContext) -> WorkflowResult:
    """Whole designs, criticism, then refinement with simulations."""
    run.begin_stage(INITIAL)
    return await refinement.design_and_refine(run)


ITERATIVE = Workflow(
    "iterative",
    iterative,
    refinement.count_calls,
    refinement.count_rollouts,
    tried=refinement.count_tried,
    adapt=refinement.within_limit,
    baseline=RANDOM_DSL.name,
    searches=True,
)
