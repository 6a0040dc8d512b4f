"""Owns how machines of a run are tried: one task, a pool of workers, each machine simulated once.

Implements the workflows' `Laboratory`; what a rollout is belongs to env, what it means to search.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import numpy as np

from agentflow.env.drawing.stills import png_url
from agentflow.env.pool.pool import Simulator
from agentflow.env.pool.spool import Rollouts
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Trace
from agentflow.env.tasks.base import Task
from agentflow.machine.tree import Machine
from agentflow.search.node import Evaluation
from agentflow.workflows.base import SimulationSummary

PICTURE = (960, 720)
"""Width and height of the pictures that models are shown, in pixels."""


class PhysicsLaboratory:
    """Tries machines at one task."""

    def __init__(self, task: Task, pool: Simulator, seed: int) -> None:
        """`seed` is of the rollouts' own chance (perturbed trials, gusts)."""
        self._task = task
        self._pool = pool
        self._seed = seed
        self.rollouts = Rollouts()
        """Every finished rollout by machine digest."""
        self.simulated_seconds = 0.0
        """Of the machines' own time, all rollouts together."""
        self.worker_seconds = 0.0
        """Of the time that workers took for them."""
        self._pictures: dict[str, asyncio.Task[str]] = {}

    async def evaluate(self, machine: Machine, label: str) -> Evaluation:  # noqa: ARG002
        """Simulate a machine.

        Raises:
            RunError: There is no room for the states that it went through.
        """
        rollout = await self._pool.run(machine, self._task, seed=self._seed)
        self.rollouts.put(machine.digest, rollout)
        self.simulated_seconds += rollout.sim_seconds or 0.0
        self.worker_seconds += rollout.wall_seconds or 0.0
        summary = SimulationSummary(
            score=rollout.score,
            status=rollout.status,
            feedback=rollout.feedback.text,
            broken=tuple((item.block, item.partner, item.time) for item in rollout.broken),
            digest=rollout.digest,
            moved=None if rollout.trace is None else farthest(rollout.trace),
        )
        return Evaluation(rollout.status != "invalid", rollout.score, summary)

    async def query(self, machine: Machine, queries: Sequence[object]) -> str:
        """Answer queries on a machine that has been evaluated."""
        return answer_queries(machine, self.rollouts[machine.digest], queries).text

    async def views(self, machine: Machine) -> tuple[str, ...]:
        """Draw a machine as built, once; beside the event loop, which goes on meanwhile."""
        if machine.digest not in self._pictures:
            drawing = asyncio.to_thread(png_url, machine, view="sheet", size=PICTURE)
            self._pictures[machine.digest] = asyncio.ensure_future(drawing)
        return (await asyncio.shield(self._pictures[machine.digest]),)


def farthest(trace: Trace) -> float:
    """How far the centre of any block got from where it was at t = 0, m, to the millimetre."""
    away = np.linalg.norm(trace.centre - trace.centre[0], axis=-1)
    return round(float(away.max()), 3)
