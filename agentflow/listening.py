"""Serving HTTP on a socket of this machine, until somebody asks for the end; needs uvicorn."""

import asyncio
import os
import secrets
import signal
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from agentflow.errors import UsageError

HEAD_S = 10.0
"""Seconds until the head of the first request of a connection must be there."""
GRACE_S = 2
"""Seconds that requests in progress have when the server ends."""


def listen(host: str, port: int, advice: str = "") -> socket.socket:
    """A socket that listens on an address of this machine, such as `127.0.0.1` or `[::1]`.

    Raises:
        UsageError: The address is not this machine's, or the port is in use; ends with `advice`.
    """
    name = host.strip("[]")
    family = socket.AF_INET6 if ":" in name else socket.AF_INET
    # asyncio sends without delay only on sockets that name their protocol.
    listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        if os.name == "posix":  # elsewhere it would let two servers share a port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:  # an address stands for nothing but itself
            listening.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listening.bind((name, port))
        listening.listen()
    except OSError as error:
        listening.close()
        why = error.strerror or error
        raise UsageError(f"cannot listen on {host}:{port}: {why}{advice}") from None
    return listening


def make_token() -> str:
    """A token that nobody can guess."""
    return secrets.token_urlsafe(32)


def is_secret(given: str, secret: str) -> bool:
    """Whether somebody has given a secret; takes as long for a wrong one."""
    return secrets.compare_digest(given.encode("utf-8", "surrogatepass"), secret.encode())


@asynccontextmanager
async def serving(
    app: ASGIApp, listening: socket.socket, most: int | None = None
) -> AsyncIterator[None]:
    """Serve an application on a socket while the context is open, with no log: it holds tokens.

    Args:
        app: Answers the requests.
        listening: Is closed at the end.
        most: Most connections at a time; the oldest that asks nothing makes place for another.
            None: any number.
    """
    config = uvicorn.Config(
        app,
        http=_Impatient,
        ws="none",
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        limit_concurrency=most,
        timeout_graceful_shutdown=2 * GRACE_S,
    )
    server = _Server(config)
    task = asyncio.create_task(server.serve(sockets=[listening]))
    try:
        yield
    finally:
        server.should_exit = True
        try:
            await asyncio.wait({task}, timeout=GRACE_S)
        finally:  # also at a second Ctrl-C: streams end without words if their connections do
            state = server.server_state
            for connection in tuple(state.connections):
                connection.transport.close()
            await asyncio.wait({task, *state.tasks}, timeout=GRACE_S)


async def end_is_asked_for() -> None:
    """Wait for Ctrl-C or SIGTERM; those that come later interrupt the program as usual."""
    asked, loop = asyncio.Event(), asyncio.get_running_loop()

    def ask(*_: object) -> None:
        loop.call_soon_threadsafe(asked.set)

    # Not `loop.add_signal_handler`, which Windows lacks.
    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        await asked.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Server(uvicorn.Server):
    """Leaves signals to the program around it."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


class _Impatient(H11Protocol):
    """Closes connections that do not ask anything in time, or whose place another one needs."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._since = self.loop.time()
        self.loop.call_later(HEAD_S, self._close_if_silent)
        most = self.limit_concurrency
        known = [each for each in self.connections if not each.transport.is_closing()]
        if most is not None and len(known) >= most:
            idle = [each for each in known if isinstance(each, _Impatient) and each._is_idle()]
            for each in sorted(idle, key=lambda each: each._since)[: len(known) - most + 1]:
                each.transport.close()

    def _is_idle(self) -> bool:
        return self.cycle is None or self.cycle.response_complete

    def _close_if_silent(self) -> None:
        if self.cycle is None and not self.transport.is_closing():
            self.transport.close()
