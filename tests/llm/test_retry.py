"""Number of attempts and waiting times."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from agentflow.errors import EndpointError, RefusedError, UnreachableError
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.messages import Reply, Request
from agentflow.llm.settings import RetrySettings
from agentflow.llm.wrappers.limits import RetryClient
from tests.llm.helpers import ask, client_for
from tests.llm.hostile import body, hang_up, reply, serving
from tests.scripted import ScriptedClient
from tests.timing import JumpingLoop

BUSY = RefusedError("busy")


def failing(times: int, error: EndpointError) -> ScriptedClient:
    def answer(_request: Request) -> str:
        if len(client.requests) <= times:
            raise error
        return "ok"

    client = ScriptedClient(answer)
    return client


def retrying(
    inner: ScriptedClient, on_wait: Callable[[str], None] = lambda _line: None, **settings: float
) -> RetryClient:
    values = {"attempts": 4, "base_s": 0.001, **settings}
    return RetryClient(inner, RetrySettings.model_validate(values), random.Random(1), on_wait)


async def test_retries_are_counted() -> None:
    client = retrying(failing(3, TransientFault(BUSY)))
    assert await client.complete(ask()) == Reply(text="ok", model="scripted", retries=3)
    assert await client.complete(ask()) == Reply(text="ok", model="scripted", retries=0)


async def test_the_last_failure_is_final() -> None:
    inner = failing(9, TransientFault(UnreachableError("gone")))
    with pytest.raises(UnreachableError) as caught:
        await retrying(inner).complete(ask())
    assert str(caught.value) == "gone (after 4 attempts)"
    assert len(inner.requests) == 4


async def test_other_errors_are_raised_at_once() -> None:
    inner = failing(9, BUSY)
    with pytest.raises(RefusedError, match=r"^busy$"):
        await retrying(inner).complete(ask())
    assert len(inner.requests) == 1


async def test_bugs_are_raised_at_once() -> None:
    def broken(_request: Request) -> str:
        raise KeyError("bug")

    with pytest.raises(KeyError):
        await retrying(ScriptedClient(broken)).complete(ask())


async def test_waits_are_jittered_within_doubling_bounds() -> None:
    lines: list[str] = []
    client = retrying(failing(5, TransientFault(BUSY)), lines.append, attempts=6, cap_s=0.004)
    await client.complete(ask())
    rng = random.Random(1)
    bounds = [0.001, 0.002, 0.004, 0.004, 0.004]
    assert lines == [f"a/1: busy; retrying in {rng.uniform(0, bound):.1f} s" for bound in bounds]


def test_retry_after_is_respected_up_to_a_cap() -> None:
    lines: list[str] = []
    fault = TransientFault(BUSY, retry_after_s=3600.0)
    client = retrying(failing(1, fault), lines.append, retry_after_cap_s=90.0)
    loop = JumpingLoop()
    try:
        loop.run_until_complete(client.complete(ask()))
        assert loop.now == pytest.approx(90.0)
    finally:
        loop.close()
    assert lines == ["a/1: busy; retrying in 90.0 s"]


@pytest.mark.parametrize("value", ["0", "Wed, 01 Jan 2020 00:00:00 GMT", "nonsense"])
async def test_over_the_network(value: str) -> None:
    busy = body({"error": {"message": "slow down"}}, 429, Retry_After=value)
    async with serving(busy, hang_up, body("", 503), reply("ok")) as server:
        inner = client_for(server.base_url)
        client = RetryClient(inner, RetrySettings(base_s=0.001), random.Random(1))
        answer = await client.complete(ask())
        await client.aclose()
    assert (answer.text, answer.retries, len(server.asked)) == ("ok", 3, 4)
