"""Owns the rescoring of a run: its machines simulated again, in today's environment (spec 6.1)."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from agentflow.app.records.reading import recorded_machine, sound
from agentflow.app.runs.conduct import Plan
from agentflow.config import build
from agentflow.env.constants import constants
from agentflow.env.pool import RolloutPool
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
            return list(await asyncio.gather(*(one(digest, pool) for digest in tried)))

    async def one(digest: str, pool: RolloutPool) -> dict[str, Any]:
        event = tried[digest]
        rollout = await pool.run(recorded_machine(path, digest), plan.task, seed=plan.config.seed)
        recorded = {"status": event.data["status"], "score": event.data["score"]}
        scores = (recorded["score"], rollout.score)
        return {
            "machine": digest,
            "place": event.label,
            "recorded": recorded,
            "now": {"status": rollout.status, "score": rollout.score},
            "difference": None if None in scores else rollout.score - recorded["score"],
            "identical": rollout.digest == event.data["rollout"] and scores[0] == scores[1],
        }

    with sound(path):
        machines = asyncio.run(compare())
    return {
        "run": str(path),
        "task": plan.task.name,
        "constants": {"recorded": document.get("constants"), "now": constants().digest},
        "identical": sum(item["identical"] for item in machines),
        "machines": machines,
    }
