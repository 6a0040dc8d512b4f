"""Owns the connections to an endpoint: one lane, with at most one connection, per call in flight.

httpx's own pool looks at all its connections for every request, several times: with 64 calls in
flight that costs more than everything else that is done for a call.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from urllib.request import getproxies

import httpx

_KEPT = 64
"""Lanes that wait for the next call; further ones are closed after their call."""
_LOOPBACK = ("all://127.0.0.1", "all://localhost", "all://[::1]")


class Lanes:
    """Lends httpx clients, the one used last first, so that its connection is still open.

    Proxies and certificates come from httpx's own reading of the environment; loopback addresses
    are never proxied. Where the environment names no proxy, lanes are spared from looking for it:
    that is two thirds of what one costs.

    Args:
        auth: How httpx proves who asks.
        timeout: Of connecting, and of each silence.

    Raises:
        ImportError: The environment names a SOCKS proxy and the package for it is missing.
        OSError: The environment names certificates that cannot be read.
        ValueError: The environment names a proxy of an unknown kind.
        httpx.InvalidURL: The environment names a proxy that is no URL.
    """

    def __init__(self, auth: httpx.Auth | None, timeout: httpx.Timeout) -> None:
        self._auth = auth
        self._timeout = timeout
        self._certificates = httpx.create_ssl_context()
        self._proxied = bool(getproxies())
        self._free = [self._new()]

    @asynccontextmanager
    async def lane(self) -> AsyncIterator[httpx.AsyncClient]:
        """A client for one call at a time."""
        http = self._free.pop() if self._free else self._new()
        try:
            yield http
        finally:
            if len(self._free) < _KEPT:
                self._free.append(http)
            else:
                await http.aclose()

    async def aclose(self) -> None:
        """Close all connections; no call may be in flight."""
        while self._free:
            await self._free.pop().aclose()

    def _new(self) -> httpx.AsyncClient:
        return httpx.AsyncClient(
            auth=self._auth,
            timeout=self._timeout,
            verify=self._certificates,
            limits=httpx.Limits(max_connections=None, max_keepalive_connections=1),
            trust_env=self._proxied,
            mounts=dict.fromkeys(_LOOPBACK) if self._proxied else None,
        )
