"""Request bodies."""

from __future__ import annotations

import json

import pytest

from agentflow.llm.endpoint.body import request_body
from agentflow.llm.messages import (
    Message,
    NamedTool,
    Reply,
    Request,
    Sampling,
    Tool,
    ToolCall,
)
from tests.llm.helpers import ask

IMAGE = "data:image/png;base64,AAAA"
CHECK = Tool(name="check", description="Check a machine.", parameters={"type": "object"})


def sent(*messages: Message) -> object:
    """The messages of a request body."""
    return request_body(Request(role="r", label="l", messages=messages), "m")["messages"]


def called(*calls: ToolCall, text: str = "") -> Message:
    return Reply(text=text, tool_calls=calls).message


def result(call: str, text: str, *images: str) -> Message:
    return Message(role="tool", text=text, images=images, tool_call_id=call)


def test_only_what_is_set_is_sent() -> None:
    assert request_body(ask("hi"), "m") == {
        "model": "m",
        "messages": [{"role": "user", "content": "hi"}],
        "stream": True,
        "stream_options": {"include_usage": True},
        "temperature": 0.7,
        "top_p": 0.95,
    }


def test_everything_that_can_be_sent() -> None:
    image = "data:image/png;base64,AAAA"
    request = Request(
        role="refiner",
        label="x",
        messages=(
            Message(role="system", text="be brief"),
            Message(role="user", text="look", images=(image,)),
        ),
        sampling=Sampling(max_tokens=9, seed=3, stop=("END",), response_format="json_object"),
    )
    body = request_body(request, "m")
    assert body["messages"] == [
        {"role": "system", "content": "be brief"},
        {
            "role": "user",
            "content": [
                {"type": "text", "text": "look"},
                {"type": "image_url", "image_url": {"url": image}},
            ],
        },
    ]
    assert (body["max_tokens"], body["seed"], body["stop"]) == (9, 3, ["END"])
    assert body["response_format"] == {"type": "json_object"}


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        ("auto", {}),
        ("none", {"tool_choice": "none"}),
        ("required", {"tool_choice": "required"}),
        (
            NamedTool(name="check"),
            {"tool_choice": {"type": "function", "function": {"name": "check"}}},
        ),
    ],
)
def test_tools(choice: object, said: dict[str, object]) -> None:
    request = ask().model_copy(update={"tools": (CHECK,), "tool_choice": choice})
    function = {
        "name": "check",
        "description": "Check a machine.",
        "parameters": {"type": "object"},
    }
    tools = {"tools": [{"type": "function", "function": function}]}
    assert request_body(request, "m") == {**request_body(ask(), "m"), **tools, **said}


def test_tool_calls_and_their_results() -> None:
    calls = (
        ToolCall(id="a", name="brief", arguments=""),
        ToolCall(id="b", name="check", arguments='{"machine": "[]"}'),
    )
    assert sent(called(*calls, text="I check."), result("a", "Throw."), result("b", "none")) == [
        {
            "role": "assistant",
            "content": "I check.",
            "tool_calls": [
                {"id": "a", "type": "function", "function": {"name": "brief", "arguments": "{}"}},
                {
                    "id": "b",
                    "type": "function",
                    "function": {"name": "check", "arguments": '{"machine": "[]"}'},
                },
            ],
        },
        {"role": "tool", "content": "Throw.", "tool_call_id": "a"},
        {"role": "tool", "content": "none", "tool_call_id": "b"},
    ]


def test_images_of_results_follow_all_results_of_a_reply() -> None:
    url = {"type": "image_url", "image_url": {"url": IMAGE}}
    calls = [ToolCall(id=key, name="look", arguments="{}") for key in "ab"]
    told = sent(called(*calls), result("a", "side", IMAGE), result("b", "top", IMAGE), called())
    assert isinstance(told, list)
    assert told[0]["content"] is None
    assert told[1:] == [
        {"role": "tool", "content": "side", "tool_call_id": "a"},
        {"role": "tool", "content": "top", "tool_call_id": "b"},
        {
            "role": "user",
            "content": [
                {"type": "text", "text": "The image of tool call a:"},
                url,
                {"type": "text", "text": "The image of tool call b:"},
                url,
            ],
        },
        {"role": "assistant", "content": ""},
    ]


@pytest.mark.parametrize(
    ("name", "arguments", "sent_name", "sent_arguments"),
    [
        ("check", ' {"machine": "', "check", {"not_json": '{"machine": "'}),
        ("check", "[1]", "check", {"not_json": "[1]"}),
        ("check", "[" * 100_000, "check", {"not_json": "[" * 100_000}),
        ("check the machine!", "{}", "check_the_machine_", {}),
        ("", "  ", "_", {}),
        ("x" * 99, "{}", "x" * 64, {}),
    ],
)
def test_calls_that_servers_reject_are_repaired(
    name: str, arguments: str, sent_name: str, sent_arguments: object
) -> None:
    told = sent(called(ToolCall(id="a", name=name, arguments=arguments)))
    assert isinstance(told, list)
    function = told[0]["tool_calls"][0]["function"]
    assert (function["name"], json.loads(function["arguments"])) == (sent_name, sent_arguments)
