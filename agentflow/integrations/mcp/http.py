"""Serving over HTTP, with a bearer token and checks of Host and Origin."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from mcp.server.auth.provider import AccessToken
from mcp.server.auth.settings import AuthSettings
from mcp.server.lowlevel import Server
from mcp.server.transport_security import TransportSecuritySettings
from pydantic import AnyHttpUrl

from agentflow.integrations.mcp.addresses import HttpAddress
from agentflow.integrations.mcp.server import OneBench, build_server
from agentflow.listening import is_secret, listen, make_token, serving
from agentflow.tools import Bench

PATH = "/mcp"
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
    listening = listen(address.host, address.port)
    port = listening.getsockname()[1]
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
    failure: Exception | None = None
    # The manager ends first: it closes the streams, for which the server would wait.
    async with serving(app, listening), server.session_manager.run():
        try:
            yield f"http://{address.name}:{port}{PATH}"
        except Exception as error:  # noqa: BLE001  # the manager would raise a group with it
            failure = error
    if failure is not None:
        raise failure


class _OneToken:
    """Accepts one token."""

    def __init__(self, token: str) -> None:
        self._token = token

    async def verify_token(self, token: str) -> AccessToken | None:
        """Compare in constant time."""
        if not is_secret(token, self._token):
            return None
        return AccessToken(token="", client_id="holder of the token", scopes=[])
