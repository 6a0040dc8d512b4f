"""Results of runs: composing them, their best machines, and saving rollouts."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import Execution
from agentflow.app.design.plan import RunPlan
from agentflow.config.run import DesignConfig
from agentflow.env.archive import save_npz
from agentflow.errors import RunError
from agentflow.files.atomic import write_output
from agentflow.machine.blocks.library import library
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.tree import Machine
from agentflow.metrics.intervals import wilson
from agentflow.runs.reading import MACHINES
from agentflow.runs.result import RunFinding, RunResult
from agentflow.search.node import Evaluation
from agentflow.workflows.base import WorkflowResult, count_passes, stage_row
from agentflow.workflows.registry import WORKFLOWS


def finding_of(plan: RunPlan, execution: Execution) -> RunFinding:
    """What a run found, by the result of its workflow."""
    result = execution.result
    best = result.best
    machine = best.machine if best else None
    counts_passes = WORKFLOWS[result.workflow].counts_passes
    verification = execution.verification
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
        "rollouts": len(execution.evaluator.rollouts),
        "stopped": result.stopped,
        "reason": result.reason,
        **({"attempts": _pass_rate(result)} if counts_passes else {}),
        **_objective_json(plan.config, result),
        **_requirements_json(execution, machine),
        **_finalists_json(execution),
        **({"makers": [asdict(maker) for maker in result.makers]} if result.makers else {}),
    }
    return RunFinding.model_validate(found)


def _objective_json(config: DesignConfig, result: WorkflowResult) -> dict[str, Any]:
    """The robust score of the best machine, and the Pareto front, if the run compared these."""
    objective, best = config.settings.objective, result.best
    if objective == "score":
        return {}
    robust = {"robust": best.evaluation.value if best and best.evaluation else None}
    if objective == "robust":
        return robust
    return {**robust, "front": [_front_member(*found) for found in result.front]}


def _finalists_json(execution: Execution) -> dict[str, Any]:
    """What was verified to choose the best machine, if more than this was."""
    rollouts, verified = execution.evaluator.rollouts, execution.verified
    if len(verified) < 2:
        return {}
    rows = [
        {
            "machine": machine.digest,
            "score": rollouts[machine.digest].score,
            "verified": found.score,
            "mean": found.mean,
            "simulations": len(found.rollouts) - 1,
        }
        for machine, found in verified.items()
    ]
    return {"finalists": rows}


def _requirements_json(execution: Execution, machine: Machine | None) -> dict[str, Any]:
    """What the best machine has of what the task requires."""
    rollouts = execution.evaluator.rollouts
    if machine is None or machine.digest not in rollouts:
        return {}
    judged = rollouts[machine.digest].requirements
    return {"requirements": [item.to_json() for item in judged]} if judged else {}


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
