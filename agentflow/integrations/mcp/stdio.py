"""Serving one client over stdin and stdout."""

from __future__ import annotations

from typing import Any

from mcp.server.lowlevel import Server
from mcp.server.runner import serve_loop
from mcp.server.stdio import stdio_server


async def serve_stdio(server: Server[Any]) -> None:
    """Serve until the client closes our stdin; other output to stdout goes to stderr meanwhile."""
    async with stdio_server() as (incoming, outgoing):
        await serve_loop(server, incoming, outgoing, lifespan_state={})
