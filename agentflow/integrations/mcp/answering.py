"""Lines over stdio that are not messages: the SDK only logs them, so senders would wait forever."""

from __future__ import annotations

import json
from typing import Any

from anyio.abc import ObjectReceiveStream
from mcp import types
from mcp.shared.message import SessionMessage
from pydantic import ValidationError

Item = SessionMessage | Exception
"""A message, or why a line is not one."""


class AnsweringStream(ObjectReceiveStream[Item]):
    """The messages of a client. Each line that is not one is answered with an error."""

    def __init__(self, incoming: Any, outgoing: Any) -> None:
        """Read from a stream of items, and answer through a stream of messages."""
        self._incoming, self._outgoing = incoming, outgoing

    async def receive(self) -> Item:
        """The next message.

        Raises:
            anyio.EndOfStream: The client has closed its end.
        """
        item: Item = await self._incoming.receive()
        while isinstance(item, ValidationError):
            if not _is_blank(item):
                await self._outgoing.send(SessionMessage(answer_to(item)))
            item = await self._incoming.receive()
        return item

    async def aclose(self) -> None:
        """Close the stream of items."""
        await self._incoming.aclose()


def answer_to(error: ValidationError) -> types.JSONRPCError:
    """The error for a line, with the line's id where it has one."""
    faults = error.errors(include_url=False)
    given = [_object(fault["input"]) for fault in faults]
    line = next((item for item in given if "jsonrpc" in item), {})
    number = line.get("id")
    known = isinstance(number, int | str) and not isinstance(number, bool)
    is_json = faults[0]["type"] != "json_invalid"
    code = types.INVALID_REQUEST if is_json else types.PARSE_ERROR
    told = f"this line is not a JSON-RPC message: {faults[0]['msg']}"
    return types.JSONRPCError(
        jsonrpc="2.0",
        id=number if known else None,
        error=types.ErrorData(code=code, message=told),
    )


def _is_blank(error: ValidationError) -> bool:
    given = error.errors(include_url=False)[0]["input"]
    return isinstance(given, str | bytes) and not given.strip()


def _object(given: object) -> dict[str, Any]:
    """Data that may be an object, or its text, which may hold what a strict reader refuses."""
    if isinstance(given, str | bytes):
        try:
            given = json.loads(given)
        except (ValueError, RecursionError):
            return {}
    return given if isinstance(given, dict) else {}
