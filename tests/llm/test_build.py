"""The complete client against a third-party server."""

from __future__ import annotations

import asyncio
import json
import logging
import traceback
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from agentflow.errors import (
    BudgetSpentError,
    ModelNotFoundError,
    RefusedError,
    UnauthorisedError,
    UnreachableError,
)
from agentflow.llm.build import open_client, wrap
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.messages import Client, Reply
from agentflow.llm.settings import EndpointSettings
from agentflow.llm.wrappers.budget import Budget, BudgetClient, BudgetSettings
from agentflow.llm.wrappers.record import CallLog, ReplayClient
from tests.conftest import free_port
from tests.llm.helpers import KEY, ask
from tests.scripted import ScriptedClient

QUICK = EndpointSettings.model_validate({"retry": {"attempts": 3, "base_s": 0.001}})


@asynccontextmanager
async def opened(
    base_url: str,
    *,
    model: str = "gpt-4o",
    settings: EndpointSettings = QUICK,
    call_log: CallLog | None = None,
    budget: Budget | None = None,
    on_wait: Callable[[str], None] = lambda _line: None,
) -> AsyncIterator[Client]:
    endpoint = Endpoint(model, base_url, KEY)
    reached = open_client(endpoint, settings, warn=pytest.fail, on_wait=on_wait)
    client: Client = reached
    if call_log is not None:
        client = wrap(reached, call_log=call_log, budget=budget or Budget())
    try:
        yield client
    finally:
        await client.aclose()


@pytest.mark.slow
async def test_a_streamed_reply(stub_url: str) -> None:
    async with opened(stub_url) as client:
        reply = await client.complete(ask("say hello"))
    assert (reply.text, reply.finish) == ("hello, machine builder", "stop")
    assert (reply.model, reply.retries, client.name) == ("gpt-4o", 0, "gpt-4o")


@pytest.mark.slow
async def test_a_trailing_slash_does_not_matter(stub_url: str) -> None:
    async with opened(stub_url + "/") as client:
        assert (await client.complete(ask("say hello"))).text == "hello, machine builder"


@pytest.mark.slow
async def test_reasoning_is_separated(stub_url: str) -> None:
    async with opened(stub_url) as client:
        reply = await client.complete(ask("ponder before you answer"))
    assert (reply.text, reply.reasoning) == ("forty-two", "seven\nsteps")


async def test_any_character_arrives(stub_url: str) -> None:
    async with opened(stub_url) as client:
        assert (await client.complete(ask("unicode"))).text == "a\u2028b \U0001f600 ü"


async def test_a_busy_server_is_retried(stub_url: str) -> None:
    waits: list[str] = []
    async with opened(stub_url, on_wait=waits.append) as client:
        reply = await client.complete(ask("are you busy"))
    assert (reply.text, reply.retries) == ("now I have time", 2)
    assert waits == [
        f"a/1: {stub_url} is temporarily unavailable (429: slow down); retrying in 0.0 s",
        f"a/1: {stub_url} is temporarily unavailable (503: restarting); retrying in 0.0 s",
    ]


async def test_errors_say_what_to_change(stub_url: str) -> None:
    async with opened(stub_url) as client:
        with pytest.raises(UnauthorisedError) as caught:
            await client.complete(ask("forbidden"))
        assert str(caught.value) == (
            f"{stub_url} rejected the API key or denied it access to model 'gpt-4o' "
            "(401: Incorrect API key provided: ***); check OPENAI_API_KEY"
        )
        with pytest.raises(RefusedError) as refused:
            await client.complete(ask("too long"))
        assert str(refused.value) == (
            f"{stub_url} rejected the request (400: maximum context length is 8192 tokens)"
        )
        with pytest.raises(RefusedError) as busy:
            await client.complete(ask("never free"))
        assert str(busy.value) == (
            f"{stub_url} is temporarily unavailable (503: no capacity) (after 3 attempts)"
        )
    async with opened(stub_url, model="nonesuch") as client:
        with pytest.raises(ModelNotFoundError) as missing:
            await client.complete(ask("hi"))
    assert str(missing.value) == (
        f"model 'nonesuch' not found at {stub_url} (404: The model does not exist); "
        "check --model and --base-url"
    )


async def test_a_wrong_path_names_the_base_url(stub_url: str) -> None:
    async with opened(stub_url + "/wrong") as client:
        with pytest.raises(ModelNotFoundError) as caught:
            await client.complete(ask("hi"))
    assert str(caught.value) == (
        f"{stub_url}/wrong has no /chat/completions, or does not know model 'gpt-4o' "
        "(404: Not Found); check OPENAI_BASE_URL or --base-url, then --model"
    )


async def test_no_server() -> None:
    base_url = f"http://127.0.0.1:{free_port()}/v1"
    async with opened(base_url) as client:
        with pytest.raises(UnreachableError) as caught:
            await client.complete(ask("hi"))
    assert str(caught.value) == (
        f"no answer from {base_url} (connection refused: is the server running?); "
        "check OPENAI_BASE_URL or --base-url (after 3 attempts)"
    )


@pytest.mark.slow
async def test_a_slow_server_is_not_a_stalled_one(stub_url: str) -> None:
    impatient = EndpointSettings.model_validate({"http": {"idle_s": 3}, "retry": {"attempts": 1}})
    async with opened(stub_url, settings=impatient) as client:
        reply = await client.complete(ask("take your time"))
        assert (reply.text, reply.latency_s > 0.2) == ("a slow but steady reply", True)
        with pytest.raises(UnreachableError, match=r"no data for 3 s"):
            await client.complete(ask("stall"))


async def test_recorded_then_replayed_without_the_server(stub_url: str, tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    labels = [f"designer/traj-{i}/1" for i in range(16)]
    with CallLog(path, pytest.fail) as call_log:
        async with opened(stub_url, call_log=call_log, budget=Budget()) as client:
            calls = [client.complete(ask("say hello", label)) for label in labels]
            recorded = await asyncio.gather(*calls)
    assert KEY not in path.read_text()
    assert stub_url not in path.read_text()
    assert {json.loads(line)["request"]["label"] for line in path.read_text().splitlines()} == set(
        labels
    )
    with CallLog(path, pytest.fail, writable=False) as call_log:
        budget = Budget(BudgetSettings(calls=16))
        client = BudgetClient(ReplayClient(call_log, "gpt-4o"), budget)
        calls = [client.complete(ask("say hello", label)) for label in labels]
        assert await asyncio.gather(*calls) == recorded
        with pytest.raises(BudgetSpentError):
            await client.complete(ask("say hello"))


async def test_the_key_is_in_no_log_and_no_traceback(
    stub_url: str, caplog: pytest.LogCaptureFixture
) -> None:
    shown = []
    with caplog.at_level(logging.DEBUG):
        async with opened(stub_url) as client:
            await client.complete(ask("say hello"))
            for text in ("forbidden", "never free"):
                try:
                    await client.complete(ask(text))
                except (UnauthorisedError, RefusedError) as error:
                    frames = traceback.TracebackException.from_exception(error, capture_locals=True)
                    shown += list(frames.format())
            shown.append(repr(client))
    assert len(shown) > 2
    assert KEY not in "".join(shown)
    assert KEY not in caplog.text


async def test_any_client_can_be_wrapped(tmp_path: Path) -> None:
    inner = ScriptedClient(["one"])
    with CallLog(tmp_path / "calls.jsonl", pytest.fail) as call_log:
        client = wrap(inner, call_log=call_log, budget=Budget(BudgetSettings(calls=1)))
        for _ in range(2):
            assert await client.complete(ask()) == Reply(text="one", model="scripted")
        with pytest.raises(BudgetSpentError):
            await client.complete(ask(label="another"))
