"""Rate limits of an endpoint: concurrent calls, calls and tokens per minute; and retries after
temporary failures."""

import asyncio
import random
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Protocol

from tenacity import AsyncRetrying, RetryCallState, retry_if_exception_type, stop_after_attempt

from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.messages import Client, ClientWrapper, Reply, Request
from agentflow.llm.settings import LimitSettings, RetrySettings


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


@dataclass
class StartedCall:
    """A call that has begun."""

    used: int | None = None
    """Tokens that it used, once known."""


class RateLimits(Protocol):
    """The rate limits of one endpoint, kept in this process or in another."""

    def call(self, tokens: int) -> AbstractAsyncContextManager[StartedCall]:
        """Enter when a call of about so many tokens may begin, and leave at its end."""


class Limiters(Protocol):
    """The rate limits of every endpoint, each shared by all its clients."""

    def of(self, base_url: str, settings: LimitSettings) -> RateLimits:
        """The limits of an endpoint; those that were asked for first hold."""


class LocalLimiters:
    """Keeps the rate limits of every endpoint in this process."""

    def __init__(self) -> None:
        self._by_url: dict[str, Limiter] = {}

    def of(self, base_url: str, settings: LimitSettings) -> RateLimits:
        """See `Limiters`."""
        return self._by_url.setdefault(base_url, Limiter(settings))


class Limiter:
    """Keeps the rate limits of one endpoint.

    Args:
        settings: The limits.
        period_s: Length of "a minute" in seconds, for tests.
    """

    def __init__(self, settings: LimitSettings, period_s: float = 60.0) -> None:
        self._slots = asyncio.Semaphore(settings.concurrent) if settings.concurrent else None
        self._calls = SlidingWindow(settings.rpm, period_s) if settings.rpm else None
        self._tokens = SlidingWindow(settings.tpm, period_s) if settings.tpm else None

    @asynccontextmanager
    async def call(self, tokens: int) -> AsyncIterator[StartedCall]:
        """See `RateLimits`."""
        async with AsyncExitStack() as stack:
            if self._slots:
                await stack.enter_async_context(self._slots)
            if self._calls:
                await self._calls.take(1)
            booked = await self._tokens.take(tokens) if self._tokens else None
            call = StartedCall()
            try:
                yield call
            finally:
                if self._tokens and booked and call.used:
                    self._tokens.correct(booked, call.used)


class LimitedClient(ClientWrapper):
    """Delays calls until the rate limits allow them."""

    def __init__(self, inner: Client, limits: RateLimits) -> None:
        super().__init__(inner)
        self._limits = limits

    async def complete(self, request: Request) -> Reply:
        """Answer one request as soon as the limits allow; see `Client`."""
        async with self._limits.call(_estimate(request)) as call:
            reply = await self._inner.complete(request)
            call.used = reply.usage.total
            return reply


def _estimate(request: Request) -> int:
    return request.estimated_tokens + (request.sampling.max_tokens or 0) + 1


def _now_s() -> float:
    return asyncio.get_running_loop().time()


class RetryClient(ClientWrapper):
    """Retries calls that fail with a `TransientFault`; other errors are raised immediately.

    Args:
        inner: The client whose calls are retried.
        settings: Number of attempts and waiting times.
        rng: Random generator for the jitter; does not affect results.
        on_wait: Called with one line of text before each wait.
    """

    def __init__(
        self,
        inner: Client,
        settings: RetrySettings,
        rng: random.Random,
        on_wait: Callable[[str], None] = lambda _line: None,
    ) -> None:
        super().__init__(inner)
        self._settings = settings
        self._rng = rng
        self._on_wait = on_wait

    async def complete(self, request: Request) -> Reply:
        """Answer one request; `Reply.retries` counts the retries.

        Raises:
            EndpointError: The last attempt failed, or one failed permanently.
        """
        retrying = AsyncRetrying(
            sleep=asyncio.sleep,
            stop=stop_after_attempt(self._settings.attempts),
            wait=self._wait_s,
            retry=retry_if_exception_type(TransientFault),
            before_sleep=self._report_wait,
            reraise=True,
        )
        try:
            reply: Reply = await retrying(self._inner.complete, request)
        except TransientFault as fault:
            raise fault.final_error(self._settings.attempts) from None
        retries = int(retrying.statistics.get("attempt_number", 1)) - 1
        return reply.model_copy(update={"retries": retries}) if retries else reply

    def _wait_s(self, state: RetryCallState) -> float:
        fault = state.outcome.exception() if state.outcome else None
        if isinstance(fault, TransientFault) and fault.retry_after_s is not None:
            return min(fault.retry_after_s, self._settings.retry_after_cap_s)
        exponent = min(state.attempt_number - 1, 30)
        longest = min(self._settings.cap_s, self._settings.base_s * 2**exponent)
        return self._rng.uniform(0.0, longest)

    def _report_wait(self, state: RetryCallState) -> None:
        fault = state.outcome.exception() if state.outcome else None
        wait = state.next_action.sleep if state.next_action else 0.0
        request: Request = state.args[0]
        self._on_wait(f"{request.label}: {fault}; retrying in {wait:.1f} s")
