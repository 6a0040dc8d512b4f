"""Verifies the score of a machine from a file."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from agentflow.env.physics.engines import choose_engine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.env.verification import Verification, score_on_others, verify_async
from agentflow.machine import Machine, check
from agentflow.machine.formats.detect import read_for


def verify_text(text: object, task: Task, *, seed: int, workers: int) -> dict[str, Any]:
    """Verify the score of one machine given as text or data, in `workers` processes.

    Returns:
        `task`, `seed`, `engine` (name and version), `score` (the plain one), `verified` (see
        `Verification.to_json`), `others` (see `score_on_others`) and `problems` (why the machine
        is invalid).
    """
    report = check(read_for(task.brief, text), task.brief)
    others: list[dict[str, Any]] = []
    if report.machine is None:
        verification = Verification.invalid(report.problems)
    else:
        verification, others = asyncio.run(_simulate(report.machine, task, seed, workers))
    return {
        "task": task.name,
        "seed": seed,
        "engine": str(choose_engine(task.engine).identity),
        "score": verification.default.score,
        "verified": verification.to_json(),
        "others": others,
        "problems": [dict(problem) for problem in verification.default.problems],
    }


async def _simulate(
    machine: Machine, task: Task, seed: int, workers: int
) -> tuple[Verification, list[dict[str, Any]]]:
    async with RolloutPool(workers) as pool:
        run = partial(pool.run, machine, seed=seed)
        return await verify_async(partial(run, task)), await score_on_others(run, task)
