"""What `agentflow mcp` does: serve one client over stdio, or any number over HTTP."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from mcp.server.lowlevel import Server

from agentflow.app.design.plan import RunPlan
from agentflow.app.sessions import ClientRuns
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import RolloutPool
from agentflow.integrations.mcp.addresses import HttpAddress
from agentflow.integrations.mcp.http import serve_http
from agentflow.integrations.mcp.server import build_server
from agentflow.integrations.mcp.stdio import serve_stdio
from agentflow.runs import Notify
from agentflow.runs.places import StageName


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
            await serve_stdio(server)

    async def serve_many(address: HttpAddress) -> None:
        async with prepare() as server, serve_http(server, address, token) as url:
            notify(f"listening on {url}; Ctrl-C ends it")
            await _end_is_asked_for()

    if address is not None:
        asyncio.run(serve_many(address))
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a thread that reads stdin cannot be interrupted
    asyncio.run(serve_one())


async def _end_is_asked_for() -> None:
    """Wait for Ctrl-C or SIGTERM; a second one ends the process at once."""
    asked, loop = asyncio.Event(), asyncio.get_running_loop()
    with suppress(NotImplementedError):  # Windows, where Ctrl-C cancels the main task
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, asked.set)
    try:
        await asked.wait()
    finally:
        with suppress(NotImplementedError):
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)
