"""Runs the workflow of a plan with given models."""

from __future__ import annotations

from contextlib import AsyncExitStack
from dataclasses import dataclass

from agentflow.agents.base import AskContext
from agentflow.app.design.laboratory import PhysicsLaboratory
from agentflow.app.design.models import Models
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import RolloutPool, Simulator
from agentflow.runs.events import RunStartEvent
from agentflow.runs.places import Place
from agentflow.workflows.base import Record, WorkflowResult
from agentflow.workflows.registry import WORKFLOWS


@dataclass(frozen=True)
class Execution:
    """The result of a workflow, and the laboratory that simulated its machines."""

    result: WorkflowResult
    laboratory: PhysicsLaboratory


async def execute(
    plan: RunPlan, models: Models, record: Record, pool: Simulator | None = None
) -> Execution:
    """Run a workflow, then close the models.

    Args:
        plan: What to do.
        models: Answer the workflow's requests.
        record: Receives every event and machine.
        pool: Simulates machines; by default a new pool of `config.workers` processes.
    """
    config = plan.config
    model = model_name(config, models)
    start = RunStartEvent(Place("start"), plan.task.name, config.workflow, model)
    record.event(start.kind, start.label, **start.data)

    def context_for(role: str) -> AskContext:
        sampling = models.choices[role].sampling
        return AskContext(models.clients[role], plan.prompts, sampling, config.max_retry)

    try:
        async with AsyncExitStack() as stack:
            if pool is None:
                pool = await stack.enter_async_context(RolloutPool(config.workers))
            laboratory = PhysicsLaboratory(plan.task, pool, config.seed)
            result = await WORKFLOWS[config.workflow](
                plan.task.brief, context_for, laboratory, config.settings, record, config.seed
            )
    finally:
        await models.aclose()
    return Execution(result, laboratory)


def model_name(config: DesignConfig, models: Models) -> str:
    """The models' name in results."""
    return models.name if WORKFLOWS[config.workflow].asks_models else "none (random edits)"
