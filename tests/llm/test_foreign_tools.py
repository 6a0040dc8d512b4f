"""Tools with third-party servers: stubllm, mock-ai-api and LiteLLM's proxy before two servers."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from agentflow.errors import RefusedError
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.messages import Client, Message, Reply, Request, Tool, ToolCall
from agentflow.llm.settings import HttpSettings
from agentflow.llm.wrappers.record import CallLog, RecordingClient, ReplayClient
from tests.llm.foreign import KEY
from tests.llm.hostile import Server

pytestmark = pytest.mark.slow

PIXEL = (
    "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8BQDwAEhQGA"
    "hKmMIQAAAABJRU5ErkJggg=="
)
SCHEMA = {"type": "object", "properties": {"machine": {"type": "string"}}, "required": ["machine"]}
TOOLS = (
    Tool(
        name="brief", description="Tell the task.", parameters={"type": "object", "properties": {}}
    ),
    Tool(name="check", description="Check a machine.", parameters=SCHEMA),
)
QUESTION = Message(role="user", text="use your tools")
REQUEST = Request(role="agent", label="a/1", messages=(QUESTION,), tools=TOOLS)
CALLS = [("brief", "{}"), ("check", '{"machine": "[]"}')]


def called(reply: Reply) -> list[tuple[str, str]]:
    return [(call.name, call.arguments) for call in reply.tool_calls]


def answered(reply: Message) -> Request:
    """The request that follows a reply with two calls: their results, one with an image."""
    texts, images = ("Throw the boulder.", "no blocks"), ((), (PIXEL,))
    results = [
        Message(role="tool", text=text, images=image, tool_call_id=call.id)
        for call, text, image in zip(reply.tool_calls, texts, images, strict=True)
    ]
    conversation = (QUESTION, reply, *results)
    return REQUEST.model_copy(update={"label": "a/2", "messages": conversation})


def opened(base_url: str, model: str, *, streamed: bool) -> OpenAIClient:
    """A client, perhaps one that has learnt that the endpoint does not stream."""
    client = OpenAIClient(Endpoint(model, base_url, KEY), HttpSettings(), pytest.fail)
    if not streamed:
        client.unsupported.actions["stream"] = "omitted"
    return client


async def use_tools(client: Client) -> None:
    """Two calls, which stubllm sends with the same index, and the reply to their results."""
    first = await client.complete(REQUEST)
    assert (first.text, first.finish, called(first)) == ("", "tool_calls", CALLS)
    second = await client.complete(answered(first.message))
    assert (second.text, second.finish) == ("I have read both results.", "stop")
    assert second.tool_calls == ()


@pytest.mark.parametrize("streamed", [True, False])
async def test_calls_are_recorded_and_replayed(
    stub_url: str, tmp_path: Path, streamed: bool
) -> None:
    client = opened(stub_url, "gpt-4o", streamed=streamed)
    with CallLog(tmp_path / "calls.jsonl", pytest.fail) as call_log:
        await use_tools(RecordingClient(client, call_log))
        assert (client.streams, len(call_log)) == (streamed, 2)
        await client.aclose()
        await use_tools(ReplayClient(call_log, "gpt-4o"))


@pytest.mark.parametrize("streamed", [True, False])
async def test_calls_through_a_gateway(gateway: str, streamed: bool) -> None:
    client = opened(gateway, "chat", streamed=streamed)
    await use_tools(client)
    assert client.streams == streamed
    await client.aclose()


async def test_a_gateway_before_another_api(gateway: str, messages_api: Server) -> None:
    client = opened(gateway, "messages", streamed=True)
    first = await client.complete(REQUEST)
    assert (first.text, first.finish, called(first)) == ("I check.", "stop", CALLS)
    broken = first.tool_calls[0].model_copy(update={"arguments": '{"a'})
    calls = (broken, *first.tool_calls[1:])
    await client.complete(answered(first.message.model_copy(update={"tool_calls": calls})))
    await client.aclose()
    sent = messages_api.asked[-1].body
    assert [tool["input_schema"] for tool in sent["tools"]] == [tool.parameters for tool in TOOLS]
    _, reply, results = sent["messages"]
    assert [part.get("input") for part in reply["content"]] == [
        None,
        {"not_json": '{"a'},
        {"machine": "[]"},
    ]
    assert [part["type"] for part in results["content"]] == [
        "tool_result",
        "tool_result",
        "text",
        "image",
    ]
    assert results["content"][3]["source"]["data"] == PIXEL.partition(",")[2]


@pytest.mark.parametrize("streamed", [True, False])
async def test_a_gateway_before_a_server_without_tools(gateway: str, streamed: bool) -> None:
    client = opened(gateway, "toolless", streamed=streamed)
    with pytest.raises(RefusedError) as caught:
        await client.complete(REQUEST)
    await client.aclose()
    assert str(caught.value).startswith(
        f"model 'toolless' at {gateway} does not support tools (400: "
    )


@pytest.mark.parametrize(
    ("model", "streamed"), [("mock-tool-stream", True), ("mock-tool-call", False)]
)
async def test_calls_of_a_mock_api(mock_api: str, model: str, streamed: bool) -> None:
    client = opened(mock_api, f"gpt-4.1:{model}", streamed=streamed)
    (call,) = (await client.complete(REQUEST)).tool_calls
    await client.aclose()
    assert call.id.startswith("call_")
    assert call.name == "Write"
    assert json.loads(call.arguments) == {"path": "tmp/mock-file.txt", "contents": "mock output"}


async def test_broken_arguments_of_a_mock_api_are_kept(mock_api: str) -> None:
    client = opened(mock_api, "gpt-4.1:mock-bad-tool-json", streamed=False)
    reply = await client.complete(REQUEST)
    await client.aclose()
    text = '{"path":"tmp/mock-file.txt","contents":"unterminated"'
    assert reply.tool_calls == (ToolCall(id=reply.tool_calls[0].id, name="Write", arguments=text),)
