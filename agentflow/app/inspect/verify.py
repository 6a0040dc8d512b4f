"""Verifies the best machine of a finished run and stores the verified score in the run."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import AsyncExitStack
from functools import partial
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import verification_event
from agentflow.app.design.plan import RunPlan, task_of_run
from agentflow.app.design.results import read_finished
from agentflow.app.inspect.reading import best_machine
from agentflow.config.run import build_config
from agentflow.env.pool.base import Simulator
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.tasks.base import Task
from agentflow.env.verification import (
    Verification,
    other_engines,
    score_on_others,
    verify_async,
)
from agentflow.machine import Machine
from agentflow.runs import Notify, RunDirectory, read_document


def verify_run(path: Path, workers: int, notify: Notify) -> dict[str, Any]:
    """The verified score of a run's best machine.

    A complete verification in the run is returned as it is. Otherwise the machine is verified, and
    the result is stored in the run, provided that the machine still has its recorded score.

    Args:
        path: A finished run.
        workers: Number of processes.
        notify: Receives the reason if the result is not stored.

    Returns:
        `run`, `task`, `seed`, `engine` (that of the run), `score` (the recorded one), `verified`
        (see `Verification.to_json`), `others` (see `score_on_others`) and `problems` (none).

    Raises:
        RunError: The run is unfinished, damaged or cannot be written, or has no valid machine.
        ConfigError: The run was not verified, and its engine is not installed.
    """
    document, result = read_document(path), read_finished(path)
    task, seed = task_of_run(path, document), build_config(document.get("config")).seed
    machine, verified = best_machine(path, result), result.get("verified")
    missing = verified is None or verified["score"] is None
    if missing:
        task = RunPlan.of_run(path, document).task
    verification, others = asyncio.run(_simulate(machine, task, seed, workers, missing))
    if verification is not None:
        verified = verification.to_json()
        now = verification.default
        if now.score == result["score"]:
            _store(path, result, machine, verification)
        else:
            found = now.status if now.score is None else f"{now.score:.2f}"
            notify(
                f"the verification is not stored in {path}: the recorded score is "
                f"{result['score']:.2f}, but simulated again with current physics, it is {found}"
            )
    return {
        "run": str(path),
        "task": task.name,
        "seed": seed,
        "engine": document.get("engine"),
        "score": result["score"],
        "verified": verified,
        "others": others,
        "problems": [],
    }


async def verify_finished(path: Path, pool: Simulator) -> None:
    """Verify a finished run that is not verified, if it has a valid machine, and store that."""
    result = read_finished(path)
    if result["valid"]:
        plan, machine = RunPlan.of_run(path, read_document(path)), best_machine(path, result)
        run = partial(pool.run, machine, plan.task, seed=plan.config.seed)
        _store(path, result, machine, await verify_async(run))


async def _simulate(
    machine: Machine, task: Task, seed: int, workers: int, missing: bool
) -> tuple[Verification | None, list[dict[str, Any]]]:
    """The verification if it is missing, and the scores on other engines."""
    async with AsyncExitStack() as stack:
        pool = RolloutPool(workers)
        if missing or other_engines(task):
            await stack.enter_async_context(pool)
        run = partial(pool.run, machine, seed=seed, recorded=True)
        verification = await verify_async(partial(run, task)) if missing else None
        return verification, await score_on_others(run, task)


def _store(
    path: Path, result: Mapping[str, Any], machine: Machine, verification: Verification
) -> None:
    """Record the verification as `design` would have, so that a replay reproduces it."""
    run = RunDirectory.resume(path)
    try:
        event = verification_event(machine, verification)
        run.event(event.kind, event.label, **event.data)
        run.finish({**result, "verified": verification.to_json()})
    finally:
        run.close()
