"""Owns what a run and its repetition have in common: names looked up, a workflow conducted."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import Any

from agentflow.agents.base import AskContext
from agentflow.app.design.laboratory import PhysicsLaboratory
from agentflow.app.design.models import Models, answerers
from agentflow.config.run import DesignConfig, hint
from agentflow.env.constants import constants
from agentflow.env.pool.pool import RolloutPool, Simulator
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from agentflow.metrics.intervals import wilson
from agentflow.prompts.render import PromptSet
from agentflow.runs.events import RunStartEvent
from agentflow.runs.places import Place
from agentflow.search.registry import STRATEGIES
from agentflow.workflows.base import Record, WorkflowResult
from agentflow.workflows.registry import WORKFLOWS
from agentflow.workflows.statistics import passes, row
from agentflow.workflows.workflow import check_fit


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
            UsageError: The workflow is not meant for such a task.
        """
        STRATEGIES[config.settings.search.strategy], WORKFLOWS[config.workflow]  # known names
        answerers(config.model)
        try:
            task = get_task(config.task, config.knobs)
        except ConfigError as error:
            raise ConfigError(f"{error}{hint(config.knobs)}") from None
        check_fit(config.workflow, task.brief)
        return cls(config, task, PromptSet(config.prompts))


@dataclass(frozen=True)
class Conducted:
    """What a workflow gave, and the laboratory that tried its machines."""

    result: WorkflowResult
    laboratory: PhysicsLaboratory


async def conduct(
    plan: Plan, models: Models, record: Record, pool: Simulator | None = None
) -> Conducted:
    """Carry out a workflow, and close the models.

    Args:
        plan: What to do.
        models: Who answers.
        record: Told everything that happens.
        pool: Where machines are simulated; its own by default, of `config.workers` processes.
    """
    config = plan.config
    model = asked(config, models)
    start = RunStartEvent(Place("start"), plan.task.name, config.workflow, model)
    record.event(start.kind, start.label, **start.data)

    def context(role: str) -> AskContext:
        return AskContext(
            models.clients[role], plan.prompts, models.samplings[role], config.max_retry
        )

    try:
        async with AsyncExitStack() as stack:
            if pool is None:
                pool = await stack.enter_async_context(RolloutPool(config.workers))
            laboratory = PhysicsLaboratory(plan.task, pool, config.seed)
            result = await WORKFLOWS[config.workflow](
                plan.task.brief,
                context,
                laboratory,
                config.settings,
                record,
                config.seed,
            )
    finally:
        await models.aclose()
    return Conducted(result, laboratory)


def answer(plan: Plan, conducted: Conducted) -> dict[str, Any]:
    """What does not depend on the clock or the place; equal for equal records."""
    result = conducted.result
    best = result.best
    machine = best.machine if best else None
    counted = {"attempts": _counted(result)} if WORKFLOWS[result.workflow].counts_passes else {}
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
        **counted,
    }


def _counted(result: WorkflowResult) -> dict[str, Any]:
    """How many attempts pass, and Wilson's 95 % interval of their share."""
    found = passes(result.stages[0])
    interval = wilson(found["passes"], found["attempts"])
    return {**found, "interval": None if interval is None else list(interval)}


def asked(config: DesignConfig, models: Models) -> str:
    """Who answers, as shown in results."""
    return models.name if WORKFLOWS[config.workflow].asks_models else "none (random edits)"


def conditions(plan: Plan) -> dict[str, str]:
    """What decides results besides the configuration and the replies: name -> hash, 16 digits.

    What a task demands is all that a brief holds; a version whose briefs hold something else begins
    anew.
    """
    return {
        "prompts": plan.prompts.digest,
        "demands": hashlib.sha256(repr(plan.task.brief).encode()).hexdigest()[:16],
        "constants": constants().digest,
    }


def changed(plan: Plan, document: Mapping[str, Any]) -> str:
    """What decides results and is no longer as when the run began, in words; "" if nothing."""
    now = conditions(plan)
    return " and ".join(name for name in now if document.get(name) != now[name])
