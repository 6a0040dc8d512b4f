"""Rate limits that clients on all nodes share: one actor keeps them, the others ask it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any
from uuid import uuid4

import ray
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from agentflow.cluster.connection import result_of
from agentflow.llm.settings import LimitSettings
from agentflow.llm.wrappers.limits import Limiter, RateLimits, StartedCall

WAITING = 100_000
"""Calls that may wait at once."""


@dataclass
class _Turn:
    """A call that waits or has begun, and the tokens that it used, once it has ended."""

    begun: asyncio.Future[None] = field(default_factory=asyncio.Future)
    ended: asyncio.Future[int | None] = field(default_factory=asyncio.Future)

    async def take(self, limiter: Limiter, tokens: int) -> None:
        try:
            async with limiter.call(tokens) as call:
                self.begun.set_result(None)
                call.used = await self.ended
        finally:
            self.begun.cancel()


class Keeper:
    """Keeps the limits of every endpoint; Ray makes an actor of it."""

    def __init__(self) -> None:
        self._limiters: dict[str, Limiter] = {}
        self._turns: dict[tuple[str, str], tuple[_Turn, asyncio.Task[None]]] = {}

    async def begin(
        self, user: str, name: str, base_url: str, settings: LimitSettings, tokens: int
    ) -> None:
        """Wait until a call may begin, which its user has named."""
        limiter = self._limiters.setdefault(base_url, Limiter(settings))
        turn = _Turn()
        self._turns[user, name] = turn, asyncio.create_task(turn.take(limiter, tokens))
        await turn.begun

    async def end(self, user: str, name: str, used: int | None) -> None:
        """End a call, or give up one that waits."""
        turn, task = self._turns.pop((user, name))
        if turn.begun.done():
            turn.ended.set_result(used)
        else:
            task.cancel()

    async def forget(self, user: str) -> None:
        """End all calls of a user that is gone."""
        for key in [key for key in self._turns if key[0] == user]:
            _, task = self._turns.pop(key)
            task.cancel()


def start_keeper() -> Any:
    """Start the actor, on the node of this process: it is gone only if that is."""
    here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
    options = {"num_cpus": 0, "max_concurrency": WAITING, "scheduling_strategy": here}
    return ray.remote(Keeper).options(**options).remote()


@dataclass(frozen=True)
class SharedLimiters:
    """The limiters that a keeper keeps, for one of its users."""

    keeper: Any
    user: str

    def of(self, base_url: str, settings: LimitSettings) -> RateLimits:
        """The limits of an endpoint; those that any user asked for first hold."""
        return _SharedLimits(self.keeper, self.user, base_url, settings)


@dataclass(frozen=True)
class _SharedLimits:
    keeper: Any
    user: str
    base_url: str
    settings: LimitSettings

    @asynccontextmanager
    async def call(self, tokens: int) -> AsyncIterator[StartedCall]:
        """See `RateLimits`."""
        call, name = StartedCall(), uuid4().hex
        begin = self.keeper.begin.remote(self.user, name, self.base_url, self.settings, tokens)
        try:
            await result_of(begin)
            yield call
        finally:
            self.keeper.end.remote(self.user, name, call.used)
