"""Third-party servers for the slow tests of the model client (`scripts/servers`)."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from tests.app.test_doctor import threaded
from tests.llm.foreign import KEY, foreign
from tests.llm.hostile import Server, body

MOCKED = {
    "greeting": "hello from a gateway",
    "busy": "litellm.RateLimitError",
    "broken": "litellm.InternalServerError",
    "long": "litellm.ContextWindowExceededError",
}
"""Models of the gateway that need no backend, and what they answer."""
CALLS = (("toolu_a", "brief", ("{}",)), ("toolu_b", "check", ('{"mach', 'ine": "[]"}')))
"""Tool calls of the messages API: id, name, JSON in pieces."""


def _messages_stream() -> str:
    """A stream of Anthropic's messages API: a text and two tool calls."""
    message = {"id": "msg_1", "type": "message", "role": "assistant", "content": [], "model": "m"}
    usage = {"input_tokens": 11, "output_tokens": 1}
    events: list[dict[str, object]] = [
        {"type": "message_start", "message": {**message, "usage": usage}},
        {"type": "content_block_start", "index": 0, "content_block": {"type": "text", "text": ""}},
        {
            "type": "content_block_delta",
            "index": 0,
            "delta": {"type": "text_delta", "text": "I check."},
        },
        {"type": "content_block_stop", "index": 0},
    ]
    for index, (key, name, pieces) in enumerate(CALLS, start=1):
        block = {"type": "tool_use", "id": key, "name": name, "input": {}}
        events.append({"type": "content_block_start", "index": index, "content_block": block})
        for piece in pieces:
            delta = {"type": "input_json_delta", "partial_json": piece}
            events.append({"type": "content_block_delta", "index": index, "delta": delta})
        events.append({"type": "content_block_stop", "index": index})
    stop = {"stop_reason": "tool_use", "stop_sequence": None}
    events.append({"type": "message_delta", "delta": stop, "usage": {"output_tokens": 20}})
    events.append({"type": "message_stop"})
    return "".join(f"event: {item['type']}\ndata: {json.dumps(item)}\n\n" for item in events)


@pytest.fixture(scope="session")
def messages_api() -> Iterator[Server]:
    """A server with Anthropic's messages API, which calls two tools and remembers requests."""
    with threaded(body(_messages_stream(), kind="text/event-stream")) as server:
        yield server


@pytest.fixture(scope="session")
def gateway(
    tmp_path_factory: pytest.TempPathFactory, stub_url: str, messages_api: Server
) -> Iterator[str]:
    """LiteLLM's proxy with mock models, and in front of two servers that call tools."""
    behind = {
        "chat": {"model": "openai/gpt-4o", "api_base": stub_url},
        "toolless": {"model": "openai/toolless", "api_base": stub_url},
        "messages": {
            "model": "anthropic/claude-sonnet-4-5",
            "api_base": messages_api.base_url.removesuffix("/v1"),
        },
        **{key: {"model": "openai/any", "mock_response": text} for key, text in MOCKED.items()},
    }
    config = {
        "model_list": [
            {"model_name": name, "litellm_params": {"api_key": "none", **model}}
            for name, model in behind.items()
        ],
        "general_settings": {"master_key": KEY},
        "router_settings": {"num_retries": 0, "disable_cooldowns": True},
        "litellm_settings": {"num_retries": 0, "telemetry": False},
    }
    folder = tmp_path_factory.mktemp("gateway")
    (folder / "gateway.yaml").write_text(json.dumps(config))
    run = "from litellm import run_server; run_server()"
    arguments = ["-c", run, "--config", "gateway.yaml", "--host", "127.0.0.1", "--port", "{port}"]
    local = {"LITELLM_LOCAL_MODEL_COST_MAP": "True"}  # else it fetches prices
    with foreign(".venv-gateway", arguments, "/health/liveliness", folder, local) as url:
        yield url


@pytest.fixture(scope="session")
def mock_api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """mock-ai-api, whose models are named after what they do."""
    arguments = ["-m", "uvicorn", "app.openai_app:app", "--host", "127.0.0.1", "--port", "{port}"]
    with foreign(".venv-mockapi", arguments, "/health", tmp_path_factory.mktemp("mock")) as url:
        yield url
