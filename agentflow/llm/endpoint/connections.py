"""A pool of connections to an endpoint: one httpx client, with one connection, per concurrent call.

httpx's own pool scans all its connections several times per request; with 64 concurrent calls that
costs more than all other work of a call.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from urllib.request import getproxies

import httpx

_MAX_IDLE = 64
"""Idle clients kept for later calls; any more are closed after use."""
_LOOPBACK = ("all://127.0.0.1", "all://localhost", "all://[::1]")


class ConnectionPool:
    """Lends httpx clients; the most recently used, whose connections are likely open, come first.

    httpx reads proxies and certificates from the environment; loopback addresses are never proxied.
    Without a proxy in the environment, clients skip looking for one, which saves two thirds of the
    cost of creating them.

    Args:
        auth: Authentication of every request.
        timeout: Time-outs for connecting and reading.

    Raises:
        ImportError: The environment sets a SOCKS proxy and the package for it is not installed.
        OSError: Certificates set in the environment cannot be read.
        ValueError: The environment sets a proxy with an unknown scheme.
        httpx.InvalidURL: The environment sets a proxy that is not a URL.
    """

    def __init__(self, auth: httpx.Auth | None, timeout: httpx.Timeout) -> None:
        self._auth = auth
        self._timeout = timeout
        self._certificates = httpx.create_ssl_context()
        self._proxied = bool(getproxies())
        self._idle = [self._new()]

    @asynccontextmanager
    async def acquire(self) -> AsyncIterator[httpx.AsyncClient]:
        """A client for the exclusive use of one call."""
        http = self._idle.pop() if self._idle else self._new()
        try:
            yield http
        finally:
            if len(self._idle) < _MAX_IDLE:
                self._idle.append(http)
            else:
                await http.aclose()

    async def aclose(self) -> None:
        """Close all connections; no call may be in progress."""
        while self._idle:
            await self._idle.pop().aclose()

    def _new(self) -> httpx.AsyncClient:
        return httpx.AsyncClient(
            auth=self._auth,
            timeout=self._timeout,
            verify=self._certificates,
            limits=httpx.Limits(max_connections=None, max_keepalive_connections=1),
            trust_env=self._proxied,
            mounts=dict.fromkeys(_LOOPBACK) if self._proxied else None,
        )
