"""Verifies the score of a machine from a file."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.env.verification import Verification, verify_async
from agentflow.machine import Machine, check
from agentflow.machine.formats.detect import read_for


def verify_text(text: object, task: Task, *, seed: int, workers: int) -> dict[str, Any]:
    """Verify the score of one machine given as text or data, in `workers` processes.

    Returns:
        `task`, `seed`, `score` (the plain one), `verified` (see `Verification.to_json`) and
        `problems` (why the machine is invalid).
    """
    report = check(read_for(task.brief, text), task.brief)
    if report.machine is None:
        verification = Verification.invalid(report.problems)
    else:
        verification = asyncio.run(_simulate(report.machine, task, seed, workers))
    return {
        "task": task.name,
        "seed": seed,
        "score": verification.default.score,
        "verified": verification.to_json(),
        "problems": [dict(problem) for problem in verification.default.problems],
    }


async def _simulate(machine: Machine, task: Task, seed: int, workers: int) -> Verification:
    async with RolloutPool(workers) as pool:
        return await verify_async(partial(pool.run, machine, task, seed=seed))
