"""Benches over a real task: the workflow's world, with workers and a record in memory."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

from agentflow.agents.base import AskContext
from agentflow.app.design.evaluator import PhysicsEvaluator
from agentflow.app.design.replay import MemoryRecord
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.registry import get_task
from agentflow.prompts.render import PromptSet
from agentflow.runs.locations import FEEDBACK, StageName
from agentflow.tools.bench import Bench
from agentflow.tools.workspace import Allowance, KnownMachines, StageBudget
from agentflow.workflows.context import WorkflowContext
from agentflow.workflows.settings import WorkflowSettings
from tests.scripted import ScriptedClient

CAR = Path("examples/car.json").read_text(encoding="utf-8")


@asynccontextmanager
async def open_bench(
    task: str = "movement",
    stage: StageName = FEEDBACK,
    *,
    submissions: int = 2,
    rollouts: int | None = 3,
    looks: int | None = 2,
    greatest: float | None = None,
    good: float | None = None,
    record: float | None = None,
) -> AsyncIterator[tuple[Bench, MemoryRecord]]:
    """A bench on real physics with one worker, and the record of its run."""
    level = get_task(task)
    memory = MemoryRecord()
    contexts = AskContext(ScriptedClient([]), PromptSet())
    async with RolloutPool(1) as pool:
        evaluator = PhysicsEvaluator(level, pool, 0, good=good, record=record)
        run = WorkflowContext(
            "tools",
            replace(level.brief, greatest=greatest),
            lambda _: contexts,
            evaluator,
            WorkflowSettings(),
            memory,
            0,
        )
        run.begin_stage(stage)
        budget = StageBudget(
            submissions,
            None if rollouts is None else Allowance.of_simulations(rollouts),
            None if looks is None else Allowance.of_pictures(looks),
        )
        yield Bench(run, stage, budget, KnownMachines()), memory
