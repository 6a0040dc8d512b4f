"""Concurrent calls, calls and tokens per period."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Iterable
from typing import Any

import pytest

from agentflow.llm.messages import Reply, Request, Usage
from agentflow.llm.settings import LimitSettings
from agentflow.llm.wrappers.limits import LimitedClient, Limiter
from tests.llm.helpers import ask
from tests.timing import JumpingLoop


class Slow:
    """Answers slowly and records when calls begin and how many overlap."""

    name = "slow"

    def __init__(self, seconds: float = 0.01, tokens: int = 0) -> None:
        self.seconds, self.tokens = seconds, tokens
        self.now = self.most = 0
        self.begun: list[float] = []

    async def complete(self, _request: Request) -> Reply:
        self.begun.append(asyncio.get_running_loop().time())
        self.now += 1
        self.most = max(self.most, self.now)
        await asyncio.sleep(self.seconds)
        self.now -= 1
        return Reply(text="x", usage=Usage(completion=self.tokens))

    async def aclose(self) -> None:
        """Nothing to release."""


def run(calls: Coroutine[Any, Any, object]) -> float:
    """Seconds that calls take, in a clock that jumps to the next thing that happens."""
    loop = JumpingLoop()
    try:
        loop.run_until_complete(calls)
        return loop.now
    finally:
        loop.close()


async def together(clients: Iterable[LimitedClient], text: str = "12345678") -> None:
    await asyncio.gather(*[client.complete(ask(text)) for client in clients])


def limited(inner: Slow, period_s: float = 60.0, **settings: int) -> LimitedClient:
    return LimitedClient(inner, Limiter(LimitSettings(**settings), period_s))


def test_no_limits_no_waiting() -> None:
    inner = Slow()
    assert run(together([limited(inner)] * 50)) == pytest.approx(0.01)
    assert inner.most == 50


def test_concurrent() -> None:
    inner = Slow()
    assert run(together([limited(inner, concurrent=3)] * 12)) == pytest.approx(0.04)
    assert inner.most == 3


def test_clients_of_one_endpoint_share_its_limits() -> None:
    inner, limiter = Slow(), Limiter(LimitSettings(concurrent=2))
    run(together(LimitedClient(inner, limiter) for _ in range(4)))
    assert inner.most == 2


def test_no_period_has_more_calls_than_allowed() -> None:
    inner = Slow(0)
    run(together([limited(inner, 0.2, rpm=5)] * 12))
    assert inner.begun == pytest.approx([0.0] * 5 + [0.2] * 5 + [0.4] * 2)


def test_tokens_are_counted_as_used_not_as_estimated() -> None:
    # Each call is estimated at 3 tokens and uses 40: two calls fill a period of 50.
    async def three() -> None:
        client = limited(inner, 1.0, tpm=50)
        for _ in range(3):
            await client.complete(ask("12345678"))

    inner = Slow(0.01, tokens=40)
    run(three())
    assert inner.begun == pytest.approx([0.0, 0.01, 1.0])


def test_a_call_above_the_token_limit_runs_alone() -> None:
    inner = Slow(0, tokens=1)
    run(together([limited(inner, 0.1, tpm=1)] * 2, "x" * 4000))
    assert inner.begun == pytest.approx([0.0, 0.1])


async def test_a_cancelled_call_frees_its_slot() -> None:
    inner = Slow(30)
    client = LimitedClient(inner, Limiter(LimitSettings(concurrent=1)))
    task = asyncio.create_task(client.complete(ask()))
    await asyncio.sleep(0.01)
    task.cancel()
    inner.seconds = 0
    await asyncio.wait_for(client.complete(ask()), 20)
