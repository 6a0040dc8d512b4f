"""Rescoring: simulates the machines of a run again with the current environment."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from agentflow.app.design.plan import RunPlan, engine_of_run, level_note
from agentflow.app.inspect.reading import later_note
from agentflow.app.subjects.subject import Subject
from agentflow.env.constants import constants
from agentflow.env.physics.engines import usable_engine
from agentflow.env.pool.base import Pool
from agentflow.env.pool.pool import RolloutPool
from agentflow.metrics.machines import recorded_machine
from agentflow.runs import read_document
from agentflow.runs.events import EvaluationEvent, read_typed_events


def rescore(
    path: Path,
    workers: int | None = None,
    engine: str | None = None,
    pool: Pool | None = None,
) -> dict[str, Any]:
    """Simulate every machine of a run again and compare.

    Args:
        path: The run, finished or not; it is not changed.
        workers: Number of processes; None: as configured in the run.
        engine: Name of the physics engine; None: that of the run, or the default one if it is not
            installed.
        pool: Simulates the machines; by default a new pool of `workers` processes.

    Returns:
        `run`, `task`, `note` (whether its level has changed), `constants` and `engine` (`recorded`
        and `now`), `identical` (number of machines with a bit-for-bit identical rollout), and
        `machines`: each with `machine`, `place` (where it was first simulated), `recorded` and
        `now` (status and score), `difference` of the scores (None if one is missing),
        `identical`, and `note`: a later rule that it breaks, which does not change its score.
    """
    document = read_document(path)
    plan = RunPlan.of_run(path, document, engine or usable_engine(engine_of_run(document)))
    evaluations: dict[str, EvaluationEvent] = {}
    for event in read_typed_events(path):
        if isinstance(event, EvaluationEvent):
            evaluations.setdefault(event.machine, event)

    async def compare() -> list[dict[str, Any]]:
        async with AsyncExitStack() as stack:
            simulator = pool
            if simulator is None:
                own = RolloutPool(workers or plan.config.workers)
                simulator = await stack.enter_async_context(own)
            return list(await asyncio.gather(*(again(one, simulator) for one in evaluations)))

    async def again(digest: str, simulator: Pool) -> dict[str, Any]:
        machine, evaluation = recorded_machine(path, digest), evaluations[digest]
        subject = Subject(machine, plan.task, plan.config.seed, evaluation.label, recorded=True)
        rollout = await subject.simulate(simulator)
        old, new = evaluation.score, rollout.score
        return {
            "machine": digest,
            "place": evaluation.label,
            "recorded": {"status": evaluation.status, "score": old},
            "now": {"status": rollout.status, "score": new},
            "difference": None if old is None or new is None else new - old,
            "identical": rollout.digest == evaluation.rollout and old == new,
            "note": later_note(machine, plan.task.brief),
        }

    machines = asyncio.run(compare())
    return {
        "run": str(path),
        "task": plan.task.name,
        "note": level_note(path, document),
        "constants": {"recorded": document.get("constants"), "now": constants().digest},
        "engine": {"recorded": document.get("engine"), "now": plan.engine},
        "identical": sum(item["identical"] for item in machines),
        "machines": machines,
    }
