"""The complete client against a third-party gateway and mock (`scripts/servers`)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from agentflow.errors import EndpointError, ModelNotFoundError, RefusedError, UnauthorisedError
from agentflow.llm.build import diagnose, open_client, wrap
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.messages import Client, JsonSchema, Usage
from agentflow.llm.settings import EndpointSettings, HttpSettings
from agentflow.llm.wrappers.budget import Budget
from agentflow.llm.wrappers.record import CallLog
from tests.llm.foreign import KEY
from tests.llm.helpers import ask

pytestmark = pytest.mark.slow


@asynccontextmanager
async def opened(
    base_url: str,
    model: str,
    on_wait: Callable[[str], None] = pytest.fail,
    key: str = KEY,
    call_log: CallLog | None = None,
) -> AsyncIterator[Client]:
    settings = EndpointSettings.model_validate({"retry": {"attempts": 3, "base_s": 0.01}})
    endpoint = Endpoint(model, base_url, key)
    client: Client = open_client(endpoint, settings, warn=pytest.fail, on_wait=on_wait)
    if call_log is not None:
        client = wrap(client, call_log=call_log, budget=Budget())
    try:
        yield client
    finally:
        await client.aclose()


async def failure(base_url: str, model: str, key: str = KEY) -> tuple[EndpointError, list[str]]:
    """The error that a call raises, and the waits before it."""
    waits: list[str] = []
    async with opened(base_url, model, waits.append, key) as client:
        with pytest.raises(EndpointError) as caught:
            await client.complete(ask("hi"))
    assert KEY not in f"{caught.value}{waits}"
    return caught.value, waits


async def test_a_gateway_answers_concurrent_calls(gateway: str, tmp_path: Path) -> None:
    with CallLog(tmp_path / "calls.jsonl", pytest.fail) as call_log:
        async with opened(gateway, "greeting", call_log=call_log) as client:
            calls = [client.complete(ask("hi", f"a/{i}")) for i in range(32)]
            replies = await asyncio.gather(*calls)
        assert len(call_log) == 32
    assert {(reply.text, reply.finish) for reply in replies} == {("hello from a gateway", "stop")}
    assert all(reply.usage != Usage() for reply in replies)
    assert KEY not in (tmp_path / "calls.jsonl").read_text()


async def test_a_gateway_accepts_every_parameter(gateway: str) -> None:
    form = JsonSchema(name="reply", content={"type": "object"})
    request = ask("hi", max_tokens=50, seed=1, stop=("END",), response_format=form)
    async with opened(gateway, "greeting") as client:
        assert (await client.complete(request)).text == "hello from a gateway"


@pytest.mark.parametrize(
    ("model", "status", "words"), [("busy", 429, "rate limit"), ("broken", 500, "internal server")]
)
async def test_calls_wait_for_a_gateways_rate_limit(
    gateway: str, model: str, status: int, words: str
) -> None:
    error, waits = await failure(gateway, model)
    assert type(error) is RefusedError
    assert str(error).startswith(f"{gateway} is temporarily unavailable ({status}: litellm.")
    assert f"mock {words} error" in str(error)
    assert str(error).endswith("(after 3 attempts)")
    assert len(waits) == 2


async def test_a_gateways_final_answers_are_final(gateway: str) -> None:
    error, waits = await failure(gateway, "long")
    assert (type(error), waits) == (RefusedError, [])
    assert "context window exceeded" in str(error)
    error, waits = await failure(gateway, "nonesuch")
    assert (type(error), waits) == (ModelNotFoundError, [])
    assert str(error).startswith(
        f"model 'nonesuch' not found at {gateway} (400: /chat/completions: "
        "Invalid model name passed in model=nonesuch."
    )


async def test_diagnosis_of_a_gateway(gateway: str) -> None:
    found = await diagnose(Endpoint("greeting", gateway, KEY), HttpSettings(), ask("hi", seed=1))
    assert (found.reachable, found.authorised, found.model_exists) == (True, True, True)
    assert (found.streaming, found.usage, found.reasoning) == (True, True, False)
    assert (dict(found.refused), found.answered_as, found.problem) == ({}, "greeting", "")
    missing = await diagnose(Endpoint("nonesuch", gateway, KEY), HttpSettings(), ask("hi", seed=1))
    assert (missing.reachable, missing.model_exists) == (True, False)


async def test_a_mock_api_answers(mock_api: str) -> None:
    async with opened(mock_api, "gpt-4.1:mock-text") as client:
        reply = await client.complete(ask("hi"))
    assert (reply.text, reply.finish) == ("Hello. It's nice to meet you.", "stop")
    assert (reply.model, reply.usage) == ("gpt-4.1", Usage(prompt=2, completion=12))


@pytest.mark.parametrize(
    ("status", "kind", "waits"),
    [
        (400, RefusedError, 0),
        (401, UnauthorisedError, 0),
        (429, RefusedError, 2),
        (500, RefusedError, 2),
        (503, RefusedError, 2),
    ],
)
async def test_a_mock_apis_status_codes(
    mock_api: str, status: int, kind: type[EndpointError], waits: int
) -> None:
    error, waited = await failure(mock_api, f"gpt-4.1:mock-{status}")
    assert (type(error), len(waited)) == (kind, waits)
    assert f"({status}: " in str(error)
