"""Concurrent calls, calls and tokens per period."""

from __future__ import annotations

import asyncio
import time

import pytest

from agentflow.llm.messages import Reply, Request, Usage
from agentflow.llm.settings import LimitSettings
from agentflow.llm.wrappers.limits import LimitedClient, Limiter
from tests.llm.helpers import ask


class Slow:
    """Answers slowly and records how many calls overlap."""

    name = "slow"

    def __init__(self, seconds: float = 0.01, tokens: int = 0) -> None:
        self.seconds, self.tokens = seconds, tokens
        self.now = self.most = 0
        self.begun: list[float] = []

    async def complete(self, _request: Request) -> Reply:
        self.begun.append(time.monotonic())
        self.now += 1
        self.most = max(self.most, self.now)
        await asyncio.sleep(self.seconds)
        self.now -= 1
        return Reply(text="x", usage=Usage(completion=self.tokens))

    async def aclose(self) -> None:
        """Nothing to release."""


async def run(inner: Slow, calls: int, settings: LimitSettings, period_s: float = 60.0) -> float:
    client = LimitedClient(inner, Limiter(settings, period_s))
    started = time.monotonic()
    await asyncio.gather(*[client.complete(ask("12345678")) for _ in range(calls)])
    await client.aclose()
    return time.monotonic() - started


async def test_no_limits_no_waiting() -> None:
    inner = Slow()
    assert await run(inner, 50, LimitSettings()) < 30
    assert inner.most == 50


async def test_concurrent() -> None:
    inner = Slow()
    await run(inner, 12, LimitSettings(concurrent=3))
    assert inner.most == 3


async def test_clients_of_one_endpoint_share_its_limits() -> None:
    inner, limiter = Slow(), Limiter(LimitSettings(concurrent=2))
    clients = [LimitedClient(inner, limiter) for _ in range(4)]
    await asyncio.gather(*[client.complete(ask()) for client in clients])
    assert inner.most == 2


async def test_no_period_has_more_calls_than_allowed() -> None:
    inner = Slow(0)
    assert 0.4 <= await run(inner, 12, LimitSettings(rpm=5), period_s=0.2) < 5
    assert all(
        later - first >= 0.199 for first, later in zip(inner.begun, inner.begun[5:], strict=False)
    )


@pytest.mark.slow
async def test_tokens_are_counted_as_used_not_as_estimated() -> None:
    # Each call is estimated at 3 tokens and uses 40: two calls fill a period of 50.
    inner = Slow(0.01, tokens=40)
    client = LimitedClient(inner, Limiter(LimitSettings(tpm=50), period_s=1.0))
    for _ in range(3):
        await client.complete(ask("12345678"))
    assert inner.begun[1] - inner.begun[0] < 0.9
    assert inner.begun[2] - inner.begun[0] >= 0.9


async def test_a_call_above_the_token_limit_runs_alone() -> None:
    inner = Slow(0, tokens=1)
    client = LimitedClient(inner, Limiter(LimitSettings(tpm=1), period_s=0.1))
    await client.complete(ask("x" * 4000))
    await client.complete(ask("x" * 4000))
    assert 0.09 < inner.begun[1] - inner.begun[0] < 5


async def test_a_cancelled_call_frees_its_slot() -> None:
    inner = Slow(30)
    client = LimitedClient(inner, Limiter(LimitSettings(concurrent=1)))
    task = asyncio.create_task(client.complete(ask()))
    await asyncio.sleep(0.01)
    task.cancel()
    inner.seconds = 0
    await asyncio.wait_for(client.complete(ask()), 20)
