"""Serves the studio on a port of 127.0.0.1 until Ctrl-C."""

from __future__ import annotations

import asyncio
import socket
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from agentflow.errors import UsageError
from agentflow.studio.access import Access
from agentflow.studio.app import Studio, build_app
from agentflow.studio.guard import Guard, Limits

HEAD_S = 10.0
"""Seconds until the head of the first request of a connection must be there."""
GRACE_S = 2
"""Seconds that requests in progress have when the server ends."""
MOST = 64
"""Most connections at a time."""


def serve(runs: Path, port: int, say: Callable[[str], None]) -> None:
    """Serve the runs of a folder and say at which address.

    Raises:
        UsageError: The port cannot be listened on.
    """

    async def serve_until_asked() -> None:
        async with running(runs, port) as (server, address):
            say(address)
            await server.serve_until_end()

    with suppress(KeyboardInterrupt):  # uvicorn raises it again after an orderly end
        asyncio.run(serve_until_asked())


@asynccontextmanager
async def running(
    runs: Path, port: int = 0, limits: Limits | None = None
) -> AsyncIterator[tuple[StudioServer, str]]:
    """A server that is ready to serve, and the address that opens it once."""
    listening = _listen(port)
    access = Access(listening.getsockname()[1])
    async with Studio.open(runs) as studio:
        app = Guard(build_app(studio), access, limits or Limits())
        yield StudioServer(app, listening), access.address


class StudioServer(uvicorn.Server):
    """Speaks HTTP on one socket; writes no log, which would hold the token."""

    def __init__(self, app: Guard, listening: socket.socket) -> None:
        """Prepare; nothing is answered yet."""
        self._listening = listening
        super().__init__(
            uvicorn.Config(
                app,
                http=_Impatient,
                ws="none",
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                limit_concurrency=MOST,
                timeout_graceful_shutdown=GRACE_S,
            )
        )

    async def serve_until_end(self) -> None:
        """Serve until `should_exit` is set or a signal comes."""
        await self.serve(sockets=[self._listening])


class _Impatient(H11Protocol):
    """Closes connections that do not ask anything in time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.loop.call_later(HEAD_S, self._close_if_idle)

    def _close_if_idle(self) -> None:
        if self.cycle is None and not self.transport.is_closing():
            self.transport.close()


def _listen(port: int) -> socket.socket:
    """Listen; asyncio sends without delay only on sockets that name their protocol."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        if sys.platform != "win32":  # where it would let two studios share a port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(("127.0.0.1", port))
        listening.listen()
        return listening
    except (OSError, OverflowError) as error:
        listening.close()
        why = getattr(error, "strerror", None) or "no such port"
        raise UsageError(
            f"cannot listen on 127.0.0.1:{port}: {why}; choose another --port"
        ) from None
