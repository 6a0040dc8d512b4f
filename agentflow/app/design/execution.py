"""Runs the workflow of a plan with given models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from math import inf
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

Repeated = Mapping[str, Sequence[Variation]]
"""Content hash of a machine that a run has verified -> its variations."""
BEST = Location("best")


@dataclass(frozen=True)
class Execution:
    """The result of a workflow, and what its machines were simulated with."""

    model: str
    """Name of the models in results, or of who designed in their place."""
    result: WorkflowResult
    evaluator: PhysicsEvaluator
    verification: Verification | None
    """That of the best machine; None without one, or if `config.verify` is off."""
    verified: Mapping[Machine, Verification] = field(default_factory=dict)
    """All that were verified to choose it, by falling score."""


async def execute(
    plan: RunPlan,
    models: Models,
    record: Record,
    pool: Simulator | None = None,
    workflow: Workflow | None = None,
    open_pool: OpenPool = RolloutPool,
    repeated: Repeated | None = None,
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
        repeated: What a run that is repeated has verified; nothing else is.
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
            verified = await _verify(result, evaluator, repeated) if config.verify else {}
            best = max(verified, key=lambda one: _mean(verified[one]), default=None)
            for number, (machine, found) in enumerate(verified.items(), 1):
                if machine != best:
                    at = Location("finalist", candidate=number)
                    record.event(verification_event(machine, found, at))
            if best is not None:
                record.event(verification_event(best, verified[best]))
    finally:
        await models.aclose()
    verification = None if best is None else verified[best]
    return Execution(model, _with_best(result, best), evaluator, verification, verified)


async def _verify(
    result: WorkflowResult, evaluator: PhysicsEvaluator, repeated: Repeated | None
) -> dict[Machine, Verification]:
    """Verify the best machine, and then others, by falling score, as long as this is higher than
    every mean score of a verification."""
    best, known = result.best, repeated or {}
    if best is None or best.machine is None:
        return {}
    finalists = {one.machine: one.score for one in result.finalists} or {best.machine: inf}
    if any(machine.digest in known for machine in finalists):
        finalists = {one: score for one, score in finalists.items() if one.digest in known}
    verified: dict[Machine, Verification] = {}
    for machine, score in finalists.items():
        if score > max(map(_mean, verified.values()), default=-inf):
            verified[machine] = await evaluator.verify(machine, known.get(machine.digest, ()))
    return verified


def _mean(verification: Verification) -> float:
    """What machines are chosen by; an incomplete verification counts as the lowest.

    The median, which is the verified score, does not see that a machine fails in some simulations.
    """
    return -inf if verification.mean is None else verification.mean


def _with_best(result: WorkflowResult, machine: Machine | None) -> WorkflowResult:
    """The result with another best machine, if it is one of the finalists."""
    found = (one for one in result.finalists if one.machine == machine)
    best = next(found, None)
    return replace(result, best=best.candidate, best_stage=best.stage) if best else result


def verification_event(
    machine: Machine, verification: Verification, at: Location = BEST
) -> VerificationEvent:
    """The event of the verification of a run's best machine, or of another one."""
    found = verification.to_json()
    scores = tuple(VariedScore(**item) for item in found.pop("scores"))
    return VerificationEvent(at, machine.digest, **found, scores=scores)


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
