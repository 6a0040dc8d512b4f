"""Verifies the best machine of a finished run and stores the verified score in the run."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import verification_event
from agentflow.app.design.plan import RunPlan
from agentflow.app.design.results import read_finished
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.verification import Verification, verify_async
from agentflow.errors import RunError
from agentflow.machine import Machine, library, read_machine
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
        `run`, `task`, `seed`, `score` (the recorded one), `verified` (see `Verification.to_json`)
        and `problems` (none).

    Raises:
        RunError: The run is unfinished, damaged or cannot be written, or has no valid machine.
    """
    document, result = read_document(path), read_finished(path)
    plan = RunPlan.of_run(path, document)
    verified = result.get("verified")
    if verified is None or verified["score"] is None:
        machine = _best_machine(path, result)
        verification = asyncio.run(_simulate(machine, plan, workers))
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
        "task": plan.task.name,
        "seed": plan.config.seed,
        "score": result["score"],
        "verified": verified,
        "problems": [],
    }


def _best_machine(path: Path, result: Mapping[str, Any]) -> Machine:
    machine = read_machine(result["machine"], library()).machine if result["valid"] else None
    if machine is None:
        raise RunError(f"{path} has no valid machine to verify; {result['reason']}")
    return machine


async def _simulate(machine: Machine, plan: RunPlan, workers: int) -> Verification:
    async with RolloutPool(workers) as pool:
        seed = plan.config.seed
        return await verify_async(partial(pool.run, machine, plan.task, seed=seed, recorded=True))


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
