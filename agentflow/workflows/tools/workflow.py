"""The workflow `tools`: a model designs machines by calling tools."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from agentflow.runs.places import STAGES, StageName
from agentflow.tools.bench import Bench
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from agentflow.workflows.tools.conversation import converse
from agentflow.workflows.tools.stages import (
    Worker,
    count_rollouts,
    reason_of,
    repeat,
    work_in_stages,
)
from agentflow.workflows.workflow import Workflow


async def tools(run: WorkflowContext) -> WorkflowResult:
    """One model works in the three stages, with up to 8 machines each and 24 simulations."""
    return await work_in_stages(run, converse(run))


def submit_each(settings: WorkflowSettings) -> WorkflowSettings:
    """One trajectory per machine that may be submitted."""
    return settings.model_copy(update={"trajectories": settings.candidates_per_stage})


def _calls(settings: WorkflowSettings) -> dict[str, int]:
    """Per machine: check and submit in every stage, and in the last an edit and a simulation."""
    many = settings.candidates_per_stage
    return {"agent": (4 if settings.start else 8) * many}


TOOLS = Workflow(
    "tools",
    tools,
    calls=_calls,
    rollouts=count_rollouts,
    adapt=submit_each,
    has_rollout_limit=True,
)


def workflow_of(worker: Worker, author: str, stages: Sequence[StageName] = STAGES) -> Workflow:
    """The workflow with somebody else as worker, who cannot be asked again.

    Args:
        worker: Works at the bench of each stage.
        author: Who it is, as results name it.
        stages: The stages, in order.
    """
    return replace(
        TOOLS,
        stages=lambda run: work_in_stages(run, worker, stages),
        author=lambda _: author,
        repeatable=False,
    )


def repetition_of(author: str, stages: Sequence[StageName]) -> Workflow:
    """The workflow of `workflow_of`, from the record: it ends where the record ends."""

    async def repeat_stages(run: WorkflowContext) -> WorkflowResult:
        async def work(bench: Bench, stage: StageName) -> None:
            bench.end(reason_of(await repeat(run, bench, stage)))

        return await work_in_stages(run, work, stages)

    return replace(TOOLS, stages=repeat_stages, author=lambda _: author, repeatable=False)
