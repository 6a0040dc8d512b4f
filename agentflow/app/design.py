"""Owns a design run from configuration to result, fresh or resumed; repeating it is replay.py's."""

from __future__ import annotations

import asyncio
import platform
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from agentflow import __version__
from agentflow.agents.base import Desk
from agentflow.app.models import Models, answerers, open_models, shown
from agentflow.app.rationales import with_rationales
from agentflow.app.remarks import REMARK, Remarks, Say
from agentflow.config import DesignConfig, build
from agentflow.env.constants import constants
from agentflow.env.pool import RolloutPool
from agentflow.env.rollout import save_npz
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import EndpointError, InterruptedRunError, RunError
from agentflow.laboratory import PhysicsLaboratory
from agentflow.llm.budget import Budget
from agentflow.llm.tape import Tape
from agentflow.prompts.render import PromptSet
from agentflow.runs import (
    Listener,
    RunDirectory,
    read_document,
    read_result,
)
from agentflow.workflows.base import Record, WorkflowResult
from agentflow.workflows.registry import WITHOUT_MODEL, workflow
from agentflow.workflows.statistics import row

RESULT = ("score", "valid", "machine", "stages", "model", "stopped", "run")
"""Keys without which a result is none."""


@dataclass(frozen=True)
class Plan:
    """A configuration whose every name has been looked up, so that nothing fails later on."""

    config: DesignConfig
    task: Task
    prompts: PromptSet

    @classmethod
    def of(cls, config: DesignConfig) -> Plan:
        """Look up task, knobs, workflow and prompt set.

        Raises:
            UnknownNameError: One of them does not exist.
            ConfigError: A knob is unknown or out of range, or a price is missing.
        """
        workflow(config.workflow)
        answerers(config.model)
        return cls(config, get_task(config.task, config.knobs), PromptSet(config.prompts))


def design(
    config: DesignConfig, out: Path, say: Say, listener: Listener | None = None
) -> dict[str, Any]:
    """Run a workflow and keep it under `out`.

    Returns:
        The content of result.json.

    Raises:
        UsageError: A name or value is wrong, or the folder cannot be written.
        EndpointError: The model cannot be used; a run without any answer leaves nothing behind.
        InterruptedRunError: Ctrl-C; the run can be resumed.
    """
    plan = Plan.of(with_rationales(config))
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    name = f"{stamp}-{plan.task.name.replace('/', '-')}-{config.workflow}-seed{config.seed}"
    return _carry_out(plan, RunDirectory.create(out, name, _document(plan)), say, listener)


def resume(path: Path, say: Say, listener: Listener | None = None) -> dict[str, Any]:
    """Continue a run; recorded calls are not asked again. A finished run gives its result.

    Raises:
        RunError: The run is damaged or in use, or prompts or physics have changed since.
    """
    if (path / "result.json").exists():
        return {**finished(path), "run": str(path)}
    document = read_document(path)
    plan = Plan.of(build(document.get("config")))
    other = changed(plan, document)
    if other:
        raise RunError(
            f"{path} was begun with other {other}: its record and a continuation would not "
            "belong together; continue it with the version that began it"
        )
    return _carry_out(plan, RunDirectory.resume(path), say, listener)


def finished(path: Path) -> dict[str, Any]:
    """The result of a finished run.

    Raises:
        RunError: The run is unfinished, or its result is damaged.
    """
    result = read_result(path)
    missing = [key for key in RESULT if key not in result]
    if missing:
        raise RunError(f"{path / 'result.json'} is damaged: it lacks {', '.join(missing)}")
    return result


@dataclass(frozen=True)
class Conducted:
    """What a workflow gave, and the laboratory that tried its machines."""

    result: WorkflowResult
    laboratory: PhysicsLaboratory


async def conduct(plan: Plan, models: Models, record: Record) -> Conducted:
    config = plan.config
    asked = _asked(config, models)
    record.event("run", "start", task=plan.task.name, workflow=config.workflow, model=asked)

    def desk(role: str) -> Desk:
        return Desk(models.clients[role], plan.prompts, models.samplings[role], config.max_retry)

    try:
        async with RolloutPool(config.workers) as pool:
            laboratory = PhysicsLaboratory(plan.task, pool, config.seed)
            result = await workflow(config.workflow)(
                plan.task.brief,
                desk,
                laboratory,
                config.settings,
                record,
                config.seed,
            )
    finally:
        await models.aclose()
    return Conducted(result, laboratory)


def _carry_out(
    plan: Plan, run: RunDirectory, say: Say, listener: Listener | None
) -> dict[str, Any]:
    started = time.monotonic()
    remarks = Remarks(run, say)
    if listener is not None:
        run.listeners.append(lambda event: None if event.kind == REMARK else listener(event))
    budget = Budget(plan.config.model.budget)
    try:
        with Tape(run.tape, remarks.tell) as tape:
            for entry in tape.entries():
                price = plan.config.model.prices.get(entry.model)
                budget.count(entry.request, entry.reply, price)
            try:
                models = open_models(plan.config, tape, budget, remarks.tell)
                conducted = asyncio.run(conduct(plan, models, run))
            except EndpointError as error:
                if not len(tape):
                    run.discard()
                    raise
                remarks.keep(str(error))
                raise type(error)(f"{error}; {_go_on(run)}") from error
            except KeyboardInterrupt:
                raise InterruptedRunError(f"interrupted; {_go_on(run)}") from None
        result = {
            **answer(plan, conducted),
            "model": _asked(plan.config, models),
            "calls": budget.calls,
            "tokens": budget.usage.total,
            "cost": None if budget.cost is None else round(budget.cost, 6),
            "seconds": round(time.monotonic() - started, 2),
            "run": str(run.path),
        }
        _keep_rollouts(run.path, conducted)
        run.finish(result)
    finally:
        run.close()
    return result


def _go_on(run: RunDirectory) -> str:
    return f"continue with: agentflow design --resume {run.path}"


def answer(plan: Plan, conducted: Conducted) -> dict[str, Any]:
    """What does not depend on the clock or the place; equal for equal records."""
    result = conducted.result
    best = result.best
    machine = best.machine if best else None
    return {
        "task": plan.task.name,
        "workflow": result.workflow,
        "seed": plan.config.seed,
        "score": best.score if best else None,
        "valid": best is not None,
        "machine": machine.to_json() if machine else None,
        "best_stage": result.best_stage,
        "stages": [row(stage) for stage in result.stages],
        "rollouts": len(conducted.laboratory.rollouts),
        "stopped": result.stopped,
        "reason": result.reason,
    }


def _asked(config: DesignConfig, models: Models) -> str:
    """Who answers, as shown in results."""
    return "none (random edits)" if config.workflow in WITHOUT_MODEL else models.name


def _keep_rollouts(path: Path, conducted: Conducted) -> None:
    """The state trajectories of every stage's best machine."""
    for stage in conducted.result.stages:
        scored = [c for c in stage.survivors if c.score is not None and c.machine is not None]
        if not scored:
            continue
        best = max(scored, key=lambda c: (c.score, -c.trajectory))
        assert best.machine is not None
        digest = best.machine.digest
        save_npz(conducted.laboratory.rollouts[digest], path / "rollouts" / f"{digest}.npz")


def changed(plan: Plan, document: Mapping[str, Any]) -> str:
    """What decides results and is no longer as when the run began, in words; "" if nothing."""
    now = {"prompts": plan.prompts.digest, "constants": constants().digest}
    return " and ".join(name for name, digest in now.items() if document.get(name) != digest)


def _document(plan: Plan) -> dict[str, Any]:
    return {
        "agentflow": __version__,
        "commit": _commit(),
        "prompts": plan.prompts.digest,
        "constants": constants().digest,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "config": shown(plan.config),
    }


def _commit() -> str | None:
    """The git commit of the code, where it runs from a checkout."""
    try:
        done = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"],
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError:
        return None
    return done.stdout.strip() or None
