"""The actor that keeps the rate limits of endpoints, called as its users call it."""

from __future__ import annotations

import asyncio

import pytest

pytest.importorskip("ray")

from agentflow.cluster.tasks import Keeper
from agentflow.llm.settings import LimitSettings

pytestmark = pytest.mark.cluster
ONE = LimitSettings(concurrent=1)
URL = "http://endpoint/v1"


async def waits(call: asyncio.Task[None]) -> bool:
    """Whether a call still waits when everything else has been done."""
    for _ in range(10):
        await asyncio.sleep(0)
    return not call.done()


async def test_users_wait_for_each_other_at_one_endpoint_only() -> None:
    keeper = Keeper()
    await keeper.begin("a", "1", URL, ONE, 10)
    await keeper.begin("b", "1", "http://other/v1", ONE, 10)
    second = asyncio.create_task(keeper.begin("b", "2", URL, ONE, 10))
    assert await waits(second)
    await keeper.end("a", "1", 7)
    assert not await waits(second)


async def test_a_call_that_is_given_up_takes_no_turn() -> None:
    keeper = Keeper()
    await keeper.begin("a", "1", URL, ONE, 10)
    given_up = asyncio.create_task(keeper.begin("a", "2", URL, ONE, 10))
    third = asyncio.create_task(keeper.begin("b", "1", URL, ONE, 10))
    assert await waits(given_up)
    await keeper.end("a", "2", None)
    await keeper.end("a", "1", None)
    assert not await waits(third)
    assert given_up.cancelled()


async def test_a_user_that_is_gone_leaves_its_turns_to_others() -> None:
    keeper = Keeper()
    await keeper.begin("gone", "1", URL, ONE, 10)
    queued = asyncio.create_task(keeper.begin("gone", "2", URL, ONE, 10))
    other = asyncio.create_task(keeper.begin("here", "1", URL, ONE, 10))
    assert await waits(other)
    await keeper.forget("gone")
    assert not await waits(other)
    assert queued.cancelled()
