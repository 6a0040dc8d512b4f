"""Clients of the SDK, as foreign programs would use them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import httpx2
from mcp import Client, types
from mcp.client.streamable_http import streamable_http_client


@asynccontextmanager
async def http_client(url: str, token: str, **options: Any) -> AsyncIterator[Client]:
    """A connected client that sends a bearer token."""
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx2.AsyncClient(headers=headers, timeout=60) as http:
        transport = streamable_http_client(url, http_client=http)
        async with Client(transport, read_timeout_seconds=60, **options) as client:
            yield client


def text_of(result: types.CallToolResult) -> str:
    """The first text of an answer."""
    first = result.content[0]
    assert isinstance(first, types.TextContent)
    return first.text


def data_of(result: types.CallToolResult) -> dict[str, Any]:
    """The data of an answer."""
    assert isinstance(result.structured_content, dict)
    return result.structured_content
