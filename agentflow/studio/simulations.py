"""A pool of simulations that starts when the page first needs one."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from typing import Any

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.machine import Machine

WORKERS = 2


class Simulations:
    """Runs rollouts like the pool that it opens; leaving the context ends it."""

    def __init__(self) -> None:
        self._stack = AsyncExitStack()
        self._pool: RolloutPool | None = None
        self._opening = asyncio.Lock()

    async def run(self, machine: Machine, task: Task, **options: Any) -> Rollout:
        """The rollout of a machine; see `RolloutPool.run`."""
        return await (await self.pool()).run(machine, task, **options)

    async def pool(self) -> RolloutPool:
        """The pool, which is open from now on."""
        async with self._opening:
            if self._pool is None:
                self._pool = await self._stack.enter_async_context(RolloutPool(WORKERS))
        return self._pool

    async def __aenter__(self) -> Simulations:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._stack.aclose()
