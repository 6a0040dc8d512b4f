"""What `agentflow mcp` does: serve one client over stdio, or any number over HTTP."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from mcp.server.lowlevel import Server
from mcp.server.runner import serve_loop
from mcp.server.stdio import stdio_server

from agentflow.app.design.plan import RunPlan
from agentflow.app.sessions.clients import ClientRuns
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import RolloutPool
from agentflow.integrations.mcp.addresses import HttpAddress
from agentflow.integrations.mcp.answering import AnsweringStream
from agentflow.integrations.mcp.http import serve_http
from agentflow.integrations.mcp.server import build_server
from agentflow.listening import end_is_asked_for
from agentflow.runs import Notify
from agentflow.runs.locations import StageName


def serve(
    config: DesignConfig,
    out: Path,
    stages: Sequence[StageName],
    notify: Notify,
    address: HttpAddress | None = None,
    token: str = "",
) -> None:
    """Serve the client at stdin and stdout until it leaves, or those of an address until Ctrl-C.

    Each client gets its own run below `out`, with the given stages.

    Raises:
        UsageError: The configuration is wrong, or the address cannot be listened on.
    """
    RunPlan.of(config)  # so that its errors reach the user, not a client

    @asynccontextmanager
    async def prepare() -> AsyncIterator[Server[Any]]:
        async with (
            RolloutPool(config.workers) as pool,
            ClientRuns(config, out, stages, pool, notify) as runs,
        ):
            yield build_server(lambda client: runs.open(f"MCP client {client}"))

    async def serve_one() -> None:
        async with prepare() as server:
            await _serve_stdio(server)

    async def serve_many(address: HttpAddress) -> None:
        async with prepare() as server, serve_http(server, address, token) as url:
            notify(f"listening on {url}; Ctrl-C ends it")
            await end_is_asked_for()

    if address is not None:
        asyncio.run(serve_many(address))
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a thread that reads stdin cannot be interrupted
    asyncio.run(serve_one())


async def _serve_stdio(server: Server[Any]) -> None:
    """Serve until the client closes our stdin; other output to stdout goes to stderr meanwhile."""
    async with stdio_server() as (incoming, outgoing):
        answered = AnsweringStream(incoming, outgoing)
        await serve_loop(server, answered, outgoing, lifespan_state={})
