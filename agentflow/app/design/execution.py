"""Runs the workflow of a plan with given models."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from agentflow.agents.analyst import Analyst
from agentflow.agents.base import AskContext
from agentflow.agents.designer import Designer
from agentflow.agents.refiner import Refiner
from agentflow.agents.registry import ROLES, with_model
from agentflow.app.design.evaluator import PhysicsEvaluator
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import DesignConfig
from agentflow.env.pool.base import OpenPool, Simulator
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.pool.store import Store
from agentflow.env.simulation.variations import Variation
from agentflow.env.verification import Verification
from agentflow.machine.tree import Machine
from agentflow.models.clients import Models
from agentflow.runs.events import RunStartEvent, VariedScore, VerificationEvent
from agentflow.runs.locations import Location
from agentflow.workflows.base import Record, WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.workflow import Workflow


@dataclass(frozen=True)
class Execution:
    """The result of a workflow, and what its machines were simulated with."""

    model: str
    """Name of the models in results, or of who designed in their place."""
    result: WorkflowResult
    evaluator: PhysicsEvaluator
    verification: Verification | None
    """That of the best machine; None without one, or if `config.verify` is off."""


async def execute(
    plan: RunPlan,
    models: Models,
    record: Record,
    pool: Simulator | None = None,
    workflow: Workflow | None = None,
    open_pool: OpenPool = RolloutPool,
    repeated: Sequence[Variation] = (),
    store: Path | None = None,
) -> Execution:
    """Run a workflow, close the models, and verify the best machine.

    Args:
        plan: What to do.
        models: Answer the workflow's requests.
        record: Receives every event and machine.
        pool: Simulates machines; by default a new pool of `config.workers` processes.
        workflow: Runs in place of the configured one of the same name.
        open_pool: Opens the new pool.
        repeated: The variations that a run that is repeated verified its best machine under.
        store: Folder that keeps all rollouts, with a new pool; by default they are not kept.
    """
    config = plan.config
    workflow = workflow or WORKFLOWS[config.workflow]
    model = model_name(config, models, workflow)
    record.event(RunStartEvent(Location("start"), plan.task.name, config.workflow, model))

    def context_for(role: str) -> AskContext:
        sampling = models.choices[role].sampling
        return AskContext(models.clients[role], plan.prompts, sampling, config.max_retry)

    try:
        async with open_pool(config.workers) if pool is None else nullcontext(pool) as opened:
            simulator = Store(store, opened) if store and pool is None else opened
            objective = config.settings.objective
            evaluator = PhysicsEvaluator(
                plan.task, simulator, config.seed, objective, plan.good, plan.record
            )
            result = await workflow(
                plan.brief, context_for, evaluator, config.settings, record, config.seed
            )
            verification = None
            if config.verify and result.best is not None and result.best.machine is not None:
                verification = await evaluator.verify(result.best.machine, repeated)
                record.event(verification_event(result.best.machine, verification))
    finally:
        await models.aclose()
    return Execution(model, result, evaluator, verification)


def verification_event(machine: Machine, verification: Verification) -> VerificationEvent:
    """The event of the verification of a run's best machine."""
    found = verification.to_json()
    scores = tuple(VariedScore(**item) for item in found.pop("scores"))
    return VerificationEvent(Location("best"), machine.digest, **found, scores=scores)


def model_name(config: DesignConfig, models: Models, workflow: Workflow) -> str:
    """The models' name in results, or that of who designs in their place."""
    settings = workflow.adapt(config.settings)
    asked = [role for role in models.clients if role in ROLES]
    if not settings.asks_analyst:
        asked.remove(Analyst.name)
    alone = {role for role in asked if ROLES[role].replies == "calls"}
    works_alone = bool(alone.intersection(workflow.calls(config.settings)))
    roles = [role for role in asked if (role in alone) == works_alone]
    if arms := settings.model_arms:  # they take the place of the run's model
        makers = (Designer.name, Refiner.name)
        roles = [role for role in roles if role not in makers]
        roles += [with_model(role, model) for model in arms for role in makers]
    return workflow.author(config.settings) or models.name_of(roles)
