"""Results of runs: composing, reading, and saving rollouts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, Field, NonNegativeInt, ValidationError

from agentflow.app.design.execution import Execution
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import DesignConfig
from agentflow.env.archive import save_npz
from agentflow.errors import RunError
from agentflow.files import write_output
from agentflow.machine.tree import Machine
from agentflow.metrics.intervals import wilson
from agentflow.runs import Event, read_result
from agentflow.runs.events import VerificationEvent, typed_event
from agentflow.search.node import Evaluation
from agentflow.workflows.base import WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.statistics import count_passes, stage_row

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

Count = NonNegativeInt
Number = Annotated[float, Field(allow_inf_nan=False)]


class _Stage(BaseModel):
    name: str
    trajectories: Count
    valid_first: Count
    valid: Count
    mean: Number | None
    max: Number | None
    attempts: Count
    children: Count


class _Passes(BaseModel):
    attempts: Count
    passes: Count
    share: Number | None
    parsed: Count
    spatial: Count
    interval: list[Number] | None


class _Member(BaseModel):
    machine: str
    score: Number
    robust: Number
    blocks: Count
    mass: Number


class _Result(BaseModel):
    """What readers of results rely on; result.json may hold more."""

    task: str
    workflow: str
    seed: int
    score: Number | None
    valid: bool
    machine: list[Any] | dict[str, list[Any]] | None
    stages: list[_Stage]
    rollouts: Count
    stopped: str | None
    reason: str
    model: str
    calls: Count
    simulated_seconds: Number
    worker_seconds: Number
    run: str
    best_stage: str | None = None
    blocks: Count | None = None
    most_blocks: Count | None = None
    tokens: Count
    cost: Number | None = None
    seconds: Number
    attempts: _Passes | None = None
    engine: str | None = None
    robust: Number | None = None
    front: list[_Member] | None = None


def result_json(plan: RunPlan, execution: Execution) -> dict[str, Any]:
    """The part of a result that a replay reproduces: no times, no paths."""
    result = execution.result
    best = result.best
    machine = best.machine if best else None
    counts_passes = WORKFLOWS[result.workflow].counts_passes
    verification = execution.verification
    attempts = {"attempts": _pass_rate(result)} if counts_passes else {}
    return {
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
        "rollouts": len(execution.laboratory.rollouts),
        "stopped": result.stopped,
        "reason": result.reason,
        **attempts,
        **_objective_json(plan.config, result),
    }


def _objective_json(config: DesignConfig, result: WorkflowResult) -> dict[str, Any]:
    """The robust score of the best machine, and the Pareto front, if the run compared these."""
    objective, best = config.settings.objective, result.best
    if objective == "score":
        return {}
    robust = {"robust": best.evaluation.value if best and best.evaluation else None}
    if objective == "robust":
        return robust
    return {**robust, "front": [_front_member(*found) for found in result.front]}


def _front_member(machine: Machine, found: Evaluation) -> dict[str, Any]:
    """A machine of the front: its hash and its `pareto_objectives`; mass in kg."""
    score, robust, blocks, mass = found.objectives or ()
    return {
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


def read_finished(path: Path) -> dict[str, Any]:
    """The result of a finished run.

    Raises:
        RunError: The run is unfinished, or its result is damaged.
    """
    result = read_result(path)
    try:
        found = _Result.model_validate(result, strict=True)
    except ValidationError as error:
        faults = error.errors()
        lacks = [_place(item) for item in faults if item["type"] == "missing"]
        first = f"its {_place(faults[0])} is {str(faults[0]['input'])[:40]!r}"
        fault = f"it lacks {', '.join(lacks)}" if lacks else first
    else:
        fault = "it is valid without a machine" * (found.valid and not found.machine)
        fault = fault or "it is valid without a stage" * (found.valid and not found.stages)
        if not _is_verification(result.get("verified")):
            fault = f"its verified is {str(result['verified'])[:40]!r}"
    if fault:
        raise RunError(f"{path / 'result.json'} is damaged: {fault}")
    return result


def trusted_score(result: Mapping[str, Any]) -> float | None:
    """The verified score of a result, or the plain one if it has no verified score."""
    verified: float | None = (result.get("verified") or {}).get("score")
    return result["score"] if verified is None else verified


def _is_verification(verified: Any) -> bool:
    """Whether this is the data of a verification, or None."""
    if verified is None:
        return True
    try:
        event = typed_event(Event(VerificationEvent.kind, "best", {**verified, "machine": ""}))
    except (TypeError, ValueError):
        return False
    return isinstance(event, VerificationEvent) and bool(event.scores)


def _place(fault: ErrorDetails) -> str:
    return ".".join(map(str, fault["loc"]))


def save_rollouts(path: Path, config: DesignConfig, execution: Execution) -> None:
    """Save the state trajectories of all machines, or of each stage's best machine."""
    rollouts = execution.laboratory.rollouts
    chosen = set(rollouts) if config.keep_rollouts == "all" else _stage_winners(execution.result)
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
