"""Owns the rescoring of a run: its machines simulated again, in today's environment (spec 6.1)."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from agentflow.app.design.conduct import Plan
from agentflow.app.inspect.reading import recorded_machine, sound
from agentflow.config.run import build
from agentflow.env.constants import constants
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.runs import Event, read_document, read_events


def rescore(path: Path, workers: int | None = None) -> dict[str, Any]:
    """Simulate every machine of a run again and compare.

    Args:
        path: The run, finished or not; nothing in it is changed.
        workers: Processes; as many as the run was configured for when None.

    Returns:
        `run`, `task`, `constants` (`recorded` and `now`), `identical` (how many machines have the
        same rollout, bit by bit), and `machines`: each with `machine`, `place` (where it was first
        tried), `recorded` and `now` (status and score), `difference` of the scores (None where
        one is missing) and `identical`.

    Raises:
        RunError: It is no run, or damaged.
        UsageError: Its task does not exist any more.
    """
    document = read_document(path)
    plan = Plan.of(build(document.get("config")))
    tried: dict[str, Event] = {}
    with sound(path):
        for event in read_events(path):
            if event.kind == "evaluation":
                tried.setdefault(event.data["machine"], event)

    async def compare() -> list[dict[str, Any]]:
        async with RolloutPool(workers or plan.config.workers) as pool:
            return list(await asyncio.gather(*(again(digest, pool) for digest in tried)))

    async def again(digest: str, pool: RolloutPool) -> dict[str, Any]:
        machine = recorded_machine(path, digest)
        return _compared(tried[digest], await pool.run(machine, plan.task, seed=plan.config.seed))

    with sound(path):
        machines = asyncio.run(compare())
    return {
        "run": str(path),
        "task": plan.task.name,
        "constants": {"recorded": document.get("constants"), "now": constants().digest},
        "identical": sum(item["identical"] for item in machines),
        "machines": machines,
    }


def _compared(tried: Event, rollout: Rollout) -> dict[str, Any]:
    """A recorded evaluation and the same machine's rollout of today."""
    recorded = {"status": tried.data["status"], "score": tried.data["score"]}
    now = {"status": rollout.status, "score": rollout.score}
    known = recorded["score"] is not None and rollout.score is not None
    return {
        "machine": tried.data["machine"],
        "place": tried.label,
        "recorded": recorded,
        "now": now,
        "difference": rollout.score - recorded["score"] if known else None,
        "identical": rollout.digest == tried.data["rollout"] and recorded["score"] == now["score"],
    }
