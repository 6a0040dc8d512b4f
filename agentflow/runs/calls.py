"""The calls of a run, `calls.jsonl`, as checked data."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, NonNegativeInt, ValidationError

from agentflow.errors import DamagedError
from agentflow.files.chains import Chains
from agentflow.files.lines import parse_object, read_lines
from agentflow.runs.reading import CALLS, RESULT


class _ToolCall(BaseModel):
    name: str
    arguments: str


class _Message(BaseModel):
    role: str
    text: str
    tool_calls: list[_ToolCall] = []


class _Request(BaseModel):
    role: str
    label: str
    messages: list[_Message] = []
    tools: list[dict[str, Any]] = []


class _Usage(BaseModel):
    prompt: NonNegativeInt
    completion: NonNegativeInt
    reasoning: NonNegativeInt
    cached: NonNegativeInt


class _Reply(BaseModel):
    text: str
    reasoning: str = ""
    reasoning_field: str = ""
    tool_calls: list[_ToolCall] = []
    usage: _Usage
    latency_s: float = Field(ge=0, allow_inf_nan=False)
    retries: NonNegativeInt


class _Call(BaseModel):
    """What readers of calls rely on; lines may hold more."""

    key: str = ""
    model: str
    request: _Request
    reply: _Reply
    after: str = ""
    shared: NonNegativeInt = 0


def read_calls(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of calls.jsonl as data: `key`, `model`, `request`, `reply`.

    Each has all its messages; in the file, a line of a conversation holds only those that are new.

    Raises:
        RunError: A line before the last is damaged, or a finished run lacks the file.
    """
    if (path / RESULT).exists() and not (path / CALLS).exists():
        raise DamagedError(f"{path / CALLS} is missing; restore it from a copy")
    conversations = Chains[Any]()
    return read_lines(path / CALLS, lambda line: _parse_call(line, conversations))


def _parse_call(line: bytes, conversations: Chains[Any]) -> dict[str, Any]:
    item = parse_object(line)
    try:
        call = _Call.model_validate(item, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the line"
        raise ValueError(f"{where}: {first['msg']}") from None
    assert item is not None
    request = item["request"]
    if call.after:
        own = request.get("messages", ())
        request["messages"] = list(conversations.whole(call.after, call.shared, own))
        del item["after"], item["shared"]
    if call.request.tools:
        conversations.add(call.key, [*request.get("messages", ()), _message_of(item["reply"])])
    return item


def _message_of(reply: dict[str, Any]) -> dict[str, Any]:
    """A reply as the message of a conversation, as requests hold it."""
    said = {"role": "assistant", "text": reply["text"], "images": []}
    if reply.get("tool_calls"):
        said["tool_calls"] = reply["tool_calls"]
    if field := reply.get("reasoning_field"):
        said["extra"] = {field: reply.get("reasoning", "")}
    return said
