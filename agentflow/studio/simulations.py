"""A pool of simulations that starts when the page first needs one."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from typing import Any

from agentflow.app.pages.films import Shapes
from agentflow.app.pages.runs import ReportedMachine, film_machine
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.machine import Machine

WORKERS = 2


class Simulations(AsyncExitStack):
    """Runs rollouts like the pool that it opens; leaving the context ends it."""

    def __init__(self) -> None:
        super().__init__()
        self._pool: RolloutPool | None = None
        self._opening = asyncio.Lock()

    async def run(self, machine: Machine, task: Task, **options: Any) -> Rollout:
        """The rollout of a machine; see `RolloutPool.run`."""
        return await (await self.pool()).run(machine, task, **options)

    async def film(self, item: ReportedMachine) -> dict[str, Any]:
        """A machine with its film: the shapes and files that it uses are in the answer."""
        shapes = Shapes()
        return {"machine": await film_machine(item, shapes, await self.pool()), **shapes.data}

    async def pool(self) -> RolloutPool:
        """The pool, which is open from now on."""
        async with self._opening:
            if self._pool is None:
                self._pool = await self.enter_async_context(RolloutPool(WORKERS))
        return self._pool
