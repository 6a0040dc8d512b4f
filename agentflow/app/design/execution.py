"""Runs the workflow of a plan with given models, composes its result, and saves rollouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

from agentflow.agents.analyst import Analyst
from agentflow.agents.base import AskContext
from agentflow.agents.designer import Designer
from agentflow.agents.refiner import Refiner
from agentflow.agents.registry import ROLES, with_model
from agentflow.app.design.evaluator import PhysicsEvaluator
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import DesignConfig
from agentflow.env.archive import save_npz
from agentflow.env.pool.pool import OpenPool, RolloutPool, Simulator
from agentflow.env.pool.store import Store
from agentflow.env.simulation.variations import Variation
from agentflow.env.verification import Verification
from agentflow.errors import RunError
from agentflow.files.atomic import write_output
from agentflow.machine import Machine, library, read_machine
from agentflow.metrics.intervals import wilson
from agentflow.models.choices import Models
from agentflow.runs import RunResult
from agentflow.runs.events import RunStartEvent, VariedScore, VerificationEvent
from agentflow.runs.locations import Location
from agentflow.runs.reading import MACHINES
from agentflow.runs.result import RunFinding
from agentflow.search.node import Evaluation
from agentflow.workflows.base import Record, WorkflowResult, count_passes, stage_row
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.workflow import Workflow


def finding_of(plan: RunPlan, execution: Execution) -> RunFinding:
    """What a run found, by the result of its workflow."""
    result, rollouts = execution.result, execution.evaluator.rollouts
    best, verification = result.best, execution.verification
    machine = best.machine if best else None
    judged = rollouts[machine.digest].requirements if machine and machine.digest in rollouts else ()
    found = {
        "task": plan.task.name,
        "workflow": result.workflow,
        "seed": plan.config.seed,
        "score": best.score if best else None,
        "verified": verification.to_json() if verification else None,
        "valid": best is not None,
        "machine": machine.to_json() if machine else None,
        **plan.task.brief.budget_json(machine),
        "best_stage": result.best_stage,
        "stages": [stage_row(stage) for stage in result.stages],
        "rollouts": len(rollouts),
        "stopped": result.stopped,
        "reason": result.reason,
    }
    objective = plan.config.settings.objective
    if objective != "score":
        found["robust"] = best.evaluation.value if best and best.evaluation else None
    if objective == "pareto":
        found["front"] = [_front_member(*member) for member in result.front]
    some = {
        "attempts": _pass_rate(result) if WORKFLOWS[result.workflow].counts_passes else None,
        "requirements": [item.to_json() for item in judged],
        "finalists": _finalists(execution) if len(execution.verified) > 1 else None,
        "makers": [asdict(maker) for maker in result.makers],
    }
    return RunFinding.model_validate(found | {key: value for key, value in some.items() if value})


def _finalists(execution: Execution) -> list[dict[str, Any]]:
    """What was verified to choose the best machine."""
    rollouts, verified = execution.evaluator.rollouts, execution.verified
    return [
        {
            "machine": machine.digest,
            "score": rollouts[machine.digest].score,
            "verified": found.score,
            "mean": found.mean,
            "simulations": len(found.rollouts) - 1,
        }
        for machine, found in verified.items()
    ]


def _front_member(machine: Machine, found: Evaluation) -> dict[str, Any]:
    """A machine of the front: its hash and its `pareto_objectives`; mass in kg."""
    score, robust, blocks, mass, *required = found.objectives or ()
    return {
        **({"required": required} if required else {}),
        "machine": machine.digest,
        "score": score,
        "robust": robust,
        "blocks": -int(blocks),
        "mass": -mass,
    }


def _pass_rate(result: WorkflowResult) -> dict[str, Any]:
    """Number of attempts, number of passes, and Wilson's 95 % interval of the pass rate."""
    found = count_passes(result.stages[0])
    interval = wilson(found["passes"], found["attempts"])
    return {**found, "interval": None if interval is None else list(interval)}


def best_machine(result: RunResult | None) -> Machine | None:
    """The best machine in the result of a run, if any."""
    if result is None or not result.valid:
        return None
    return read_machine(result.machine, tuple(library())).machine


def machine_file(result: RunResult) -> dict[str, str]:
    """The path of the best machine of a run as `machine`; {} if there is none."""
    machine = best_machine(result)
    return {"machine": str(Path(result.run, MACHINES, f"{machine.digest}.json"))} if machine else {}


def save_rollouts(path: Path, config: DesignConfig, execution: Execution) -> None:
    """Save the state trajectories of all machines, or of the best one and each stage's best."""
    rollouts = execution.evaluator.rollouts
    best = execution.result.best
    chosen = {best.machine.digest} if best and best.machine else set()
    chosen |= set(rollouts) if config.keep_rollouts == "all" else _stage_winners(execution.result)
    for digest in sorted(chosen):
        with write_output(path / "rollouts" / f"{digest}.npz", RunError) as part:
            save_npz(rollouts[digest], part)


def _stage_winners(result: WorkflowResult) -> set[str]:
    """Digest of each stage's best machine; of equally good ones, the lowest trajectory's."""
    winners = set()
    for stage in result.stages:
        ranked = [
            (candidate.reward, -candidate.trajectory, candidate.machine.digest)
            for candidate in stage.survivors
            if candidate.reward is not None and candidate.machine
        ]
        if ranked:
            winners.add(max(ranked, key=lambda item: item[:2])[2])
    return winners


Repeated = Mapping[str, Sequence[Variation]]
"""Content hash of a machine that a run has verified -> its variations."""
BEST = Location("best")


@dataclass(frozen=True)
class Execution:
    """The result of a workflow, and what its machines were simulated with.

    `model` names the models in results, or who designed in their place. `verification` is that of
    the best machine; None without one, or if `config.verify` is off. `verified` are all that were
    verified to choose it, by falling score.
    """

    model: str
    result: WorkflowResult
    evaluator: PhysicsEvaluator
    verification: Verification | None
    verified: Mapping[Machine, Verification] = field(default_factory=dict)


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
            most_calls = config.model.budget.calls
            result = await workflow(
                plan.brief, context_for, evaluator, config.settings, record, config.seed, most_calls
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
