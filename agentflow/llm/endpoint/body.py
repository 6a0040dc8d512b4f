"""The JSON body of a request to `/chat/completions`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from agentflow.llm.endpoint.tool_calls import is_json_object
from agentflow.llm.messages import JsonSchema, Message, NamedTool, Request, ToolCall

_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_-]")
_MAX_NAME_CHARS = 64
"""Endpoints reject a conversation in which a tool has a name with other characters, or longer."""


def request_body(request: Request, model: str) -> dict[str, object]:
    """Build the body of a streamed request without fields that are None, empty or the default."""
    sampling = request.sampling
    body: dict[str, object] = {
        "model": model,
        "messages": _messages(request.messages),
        "stream": True,
        "stream_options": {"include_usage": True},
        "temperature": sampling.temperature,
        "top_p": sampling.top_p,
    }
    if sampling.max_tokens is not None:
        body["max_tokens"] = sampling.max_tokens
    if sampling.seed is not None:
        body["seed"] = sampling.seed
    if sampling.stop:
        body["stop"] = list(sampling.stop)
    if isinstance(form := sampling.response_format, JsonSchema):
        schema = {"name": form.name, "schema": form.content}
        body["response_format"] = {"type": "json_schema", "json_schema": schema}
    elif form != "text":
        body["response_format"] = {"type": form}
    if request.tools:
        body["tools"] = [_function(tool.model_dump()) for tool in request.tools]
    if isinstance(choice := request.tool_choice, NamedTool):
        body["tool_choice"] = _function({"name": choice.name})
    elif choice != "auto":
        body["tool_choice"] = choice
    return body


def _messages(messages: Iterable[Message]) -> list[dict[str, object]]:
    """The messages, with the images of tool results in a user message that follows the results.

    Tool messages hold only text, and nothing may stand between those that answer one reply.
    """
    sent: list[dict[str, object]] = []
    for are_results, group in groupby(messages, key=lambda message: message.role == "tool"):
        neighbours = list(group)
        sent += [_message(message) for message in neighbours]
        if are_results and (parts := _result_images(neighbours)):
            sent.append({"role": "user", "content": parts})
    return sent


def _message(message: Message) -> dict[str, object]:
    if message.role == "tool":
        return {"role": "tool", "content": message.text, "tool_call_id": message.tool_call_id}
    if message.images:
        return {"role": message.role, "content": _parts(message.text, message.images)}
    if message.tool_calls:
        calls = [_tool_call(call) for call in message.tool_calls]
        answer = {"role": message.role, "content": message.text or None, "tool_calls": calls}
        return {**answer, **message.extra}
    return {"role": message.role, "content": message.text}


def _result_images(results: Iterable[Message]) -> list[dict[str, object]]:
    return [
        part
        for result in results
        if result.images
        for part in _parts(f"The image of tool call {result.tool_call_id}:", result.images)
    ]


def _parts(text: str, images: Sequence[str]) -> list[dict[str, object]]:
    parts: list[dict[str, object]] = [{"type": "text", "text": text}]
    return parts + [{"type": "image_url", "image_url": {"url": url}} for url in images]


def _function(content: Mapping[str, object]) -> dict[str, object]:
    return {"type": "function", "function": content}


def _tool_call(call: ToolCall) -> dict[str, object]:
    """A call of an earlier reply, with a legal name and with arguments that are a JSON object.

    Many servers parse them to fill in a chat template, and reject the whole conversation otherwise.
    """
    name = _NOT_IN_NAMES.sub("_", call.name)[:_MAX_NAME_CHARS] or "_"
    arguments = call.arguments.strip() or "{}"
    if not is_json_object(arguments):
        arguments = json.dumps({"not_json": arguments})
    extra = {"extra_content": json.loads(call.extra_content)} if call.extra_content else {}
    return {"id": call.id, **_function({"name": name, "arguments": arguments}), **extra}
