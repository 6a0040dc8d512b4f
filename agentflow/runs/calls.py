"""The calls of a run, `calls.jsonl`, as checked data."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, NonNegativeInt, ValidationError

from agentflow.files.lines import parse_object, read_lines
from agentflow.runs.reading import CALLS


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


class _Usage(BaseModel):
    prompt: NonNegativeInt
    completion: NonNegativeInt
    reasoning: NonNegativeInt
    cached: NonNegativeInt


class _Reply(BaseModel):
    text: str
    reasoning: str = ""
    tool_calls: list[_ToolCall] = []
    usage: _Usage
    latency_s: float = Field(ge=0, allow_inf_nan=False)
    retries: NonNegativeInt


class _Call(BaseModel):
    """What readers of calls rely on; lines may hold more."""

    model: str
    request: _Request
    reply: _Reply


def read_calls(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of calls.jsonl as data: `key`, `model`, `request`, `reply`.

    Raises:
        RunError: A line before the last is damaged.
    """
    return read_lines(path / CALLS, _parse_call)


def _parse_call(line: bytes) -> dict[str, Any]:
    item = parse_object(line)
    try:
        _Call.model_validate(item, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the line"
        raise ValueError(f"{where}: {first['msg']}") from None
    assert item is not None
    return item
