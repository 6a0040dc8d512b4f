"""Rate limits of an endpoint: concurrent calls, calls and tokens per minute."""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import AsyncExitStack
from dataclasses import dataclass

from agentflow.llm.client import Client, ClientWrapper
from agentflow.llm.messages import Reply, Request
from agentflow.llm.settings import LimitSettings


@dataclass
class _Booking:
    time_s: float
    amount: int


class SlidingWindow:
    """Limits the sum of amounts within a sliding time window; first come, first served.

    Args:
        limit: Maximum sum.
        period_s: Length of the window in seconds.
    """

    def __init__(self, limit: int, period_s: float) -> None:
        self._limit = limit
        self._period_s = period_s
        self._bookings: deque[_Booking] = deque()
        self._sum = 0
        self._turn = asyncio.Lock()

    async def take(self, amount: int) -> _Booking:
        """Wait until an amount fits, then book it; above the limit, wait for an empty window."""
        async with self._turn:
            while (wait := self._wait_s(amount)) > 0:
                await asyncio.sleep(wait)
            booking = _Booking(_now_s(), amount)
            self._bookings.append(booking)
            self._sum += amount
            return booking

    def correct(self, booking: _Booking, amount: int) -> None:
        """Replace a booked amount by the actual one."""
        if booking.time_s > _now_s() - self._period_s:
            self._sum += amount - booking.amount
            booking.amount = amount

    def _wait_s(self, amount: int) -> float:
        now = _now_s()
        while self._bookings and self._bookings[0].time_s <= now - self._period_s:
            self._sum -= self._bookings.popleft().amount
        if not self._bookings or self._sum + amount <= self._limit:
            return 0.0
        return max(self._bookings[0].time_s + self._period_s - now, 0.001)


class Limiter:
    """Rate limits of one endpoint, shared by all its clients.

    Args:
        settings: The limits.
        period_s: Length of "a minute" in seconds, for tests.
    """

    def __init__(self, settings: LimitSettings, period_s: float = 60.0) -> None:
        self.slots = asyncio.Semaphore(settings.concurrent) if settings.concurrent else None
        self.calls = SlidingWindow(settings.rpm, period_s) if settings.rpm else None
        self.tokens = SlidingWindow(settings.tpm, period_s) if settings.tpm else None


class LimitedClient(ClientWrapper):
    """Delays calls until the rate limits allow them."""

    def __init__(self, inner: Client, limiter: Limiter) -> None:
        super().__init__(inner)
        self._limiter = limiter

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


def _estimate(request: Request) -> int:
    return request.estimated_tokens + (request.sampling.max_tokens or 0) + 1


def _now_s() -> float:
    return asyncio.get_running_loop().time()
