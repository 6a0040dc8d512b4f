"""Owns how fast one endpoint is asked: calls at once, calls and tokens per minute."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from contextlib import AsyncExitStack
from dataclasses import dataclass

from agentflow.llm.client import Client
from agentflow.llm.messages import Reply, Request
from agentflow.llm.settings import LimitSettings


@dataclass
class _Entry:
    begun: float
    amount: int


class Window:
    """A sum over the last period that may not exceed a limit; first come, first served.

    Args:
        limit: Largest sum.
        period_s: Length of the period in seconds.
    """

    def __init__(self, limit: int, period_s: float) -> None:
        self._limit = limit
        self._period_s = period_s
        self._entries: deque[_Entry] = deque()
        self._sum = 0
        self._turn = asyncio.Lock()

    async def take(self, amount: int) -> _Entry:
        """Wait until the amount fits, and book it. One larger than the limit waits for all."""
        async with self._turn:
            while (wait := self._wait_s(amount)) > 0:
                await asyncio.sleep(wait)
            entry = _Entry(time.monotonic(), amount)
            self._entries.append(entry)
            self._sum += amount
            return entry

    def correct(self, entry: _Entry, amount: int) -> None:
        """Replace a booked amount by the true one."""
        if entry.begun > time.monotonic() - self._period_s:
            self._sum += amount - entry.amount
            entry.amount = amount

    def _wait_s(self, amount: int) -> float:
        now = time.monotonic()
        while self._entries and self._entries[0].begun <= now - self._period_s:
            self._sum -= self._entries.popleft().amount
        if not self._entries or self._sum + amount <= self._limit:
            return 0.0
        return max(self._entries[0].begun + self._period_s - now, 0.001)


class Limiter:
    """The limits of one endpoint, shared by all clients that ask it.

    Args:
        settings: The limits.
        period_s: What "per minute" means, in seconds.
    """

    def __init__(self, settings: LimitSettings, period_s: float = 60.0) -> None:
        self.slots = asyncio.Semaphore(settings.concurrent) if settings.concurrent else None
        self.calls = Window(settings.rpm, period_s) if settings.rpm else None
        self.tokens = Window(settings.tpm, period_s) if settings.tpm else None


class LimitedClient:
    """Holds calls back until the limits allow them."""

    def __init__(self, inner: Client, limiter: Limiter) -> None:
        self._inner = inner
        self._limiter = limiter

    @property
    def name(self) -> str:
        """The model's name."""
        return self._inner.name

    async def complete(self, request: Request) -> Reply:
        """Answer one request as soon as the limits allow; see `Client`."""
        limits = self._limiter
        async with AsyncExitStack() as stack:
            if limits.slots:
                await stack.enter_async_context(limits.slots)
            if limits.calls:
                await limits.calls.take(1)
            booked = await limits.tokens.take(_estimate(request)) if limits.tokens else None
            reply = await self._inner.complete(request)
            if limits.tokens and booked and reply.usage.total:
                limits.tokens.correct(booked, reply.usage.total)
            return reply

    async def aclose(self) -> None:
        """Close the inner client."""
        await self._inner.aclose()


def _estimate(request: Request) -> int:
    """Tokens that a call will probably use, before it is made."""
    return request.estimated_tokens + (request.sampling.max_tokens or 0) + 1
