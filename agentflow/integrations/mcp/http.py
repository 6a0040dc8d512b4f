"""Serving over HTTP, with a bearer token and checks of Host and Origin."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from typing import Any

import uvicorn
from mcp.server.auth.provider import AccessToken
from mcp.server.auth.settings import AuthSettings
from mcp.server.lowlevel import Server
from mcp.server.transport_security import TransportSecuritySettings
from pydantic import AnyHttpUrl

from agentflow.integrations.mcp.addresses import HttpAddress, make_token
from agentflow.integrations.mcp.server import build_server
from agentflow.integrations.mcp.session import OneBench
from agentflow.tools import Bench

PATH = "/mcp"
GRACE = 2
"""Seconds that requests in progress have when the server ends."""
NOBODY = AnyHttpUrl("http://127.0.0.1")
"""Who issues tokens: the SDK asks for an address, which it tells nobody."""
ANY_PORT = HttpAddress("127.0.0.1", 0)


@dataclass(frozen=True)
class Served:
    """How a client reaches a server: `Authorization: Bearer TOKEN` at a URL."""

    url: str
    token: str


@asynccontextmanager
async def serve_bench(bench: Bench) -> AsyncIterator[Served]:
    """Serve one bench on a loopback port, inside the running event loop."""
    one = OneBench(bench)
    token = make_token()
    async with serve_http(build_server(lambda _client: one), ANY_PORT, token) as url:
        yield Served(url, token)


@asynccontextmanager
async def serve_http(server: Server[Any], address: HttpAddress, token: str) -> AsyncIterator[str]:
    """Serve while the context is open; the URL.

    Raises:
        UsageError: The address cannot be listened on.
    """
    listening = address.listen()
    port = listening.getsockname()[1]
    url = f"http://{address.name}:{port}{PATH}"
    names = address.names
    app = server.streamable_http_app(
        streamable_http_path=PATH,
        transport_security=TransportSecuritySettings(
            allowed_hosts=[f"{name}:{port}" for name in names],
            allowed_origins=[f"http://{name}:*" for name in names],
        ),
        auth=AuthSettings(issuer_url=NOBODY, resource_server_url=None),
        token_verifier=_OneToken(token),
    )
    http = _HttpServer(
        uvicorn.Config(
            app, log_config=None, access_log=False, timeout_graceful_shutdown=GRACE, lifespan="off"
        )
    )
    failure: Exception | None = None
    async with server.session_manager.run():  # ends before the server, whose streams it closes
        serving = asyncio.create_task(http.serve(sockets=[listening]))
        try:
            yield url
        except Exception as error:  # noqa: BLE001  # the manager would raise a group with it
            failure = error
        finally:
            http.should_exit = True
    await serving
    if failure is not None:
        raise failure


class _HttpServer(uvicorn.Server):
    """A server that leaves signals to the program around it."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


class _OneToken:
    """Accepts one token."""

    def __init__(self, token: str) -> None:
        self._token = token.encode()

    async def verify_token(self, token: str) -> AccessToken | None:
        """Compare in constant time."""
        if not secrets.compare_digest(token.encode(), self._token):
            return None
        return AccessToken(token="", client_id="holder of the token", scopes=[])
