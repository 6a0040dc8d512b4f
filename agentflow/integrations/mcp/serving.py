"""What `agentflow mcp` does: serve one client over stdio, or any number over HTTP with a bearer
token."""

import asyncio
import json
import signal
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from anyio.abc import ObjectReceiveStream
from mcp import types
from mcp.server.auth.provider import AccessToken
from mcp.server.auth.settings import AuthSettings
from mcp.server.lowlevel import Server
from mcp.server.runner import serve_loop
from mcp.server.stdio import stdio_server
from mcp.server.transport_security import TransportSecuritySettings
from mcp.shared.message import SessionMessage
from pydantic import AnyHttpUrl, ValidationError

from agentflow.app.design.plan import RunPlan
from agentflow.app.sessions.clients import ClientRuns
from agentflow.config.run import DesignConfig
from agentflow.env.pool.pool import RolloutPool
from agentflow.integrations.mcp.addresses import HttpAddress
from agentflow.integrations.mcp.server import OneBench, build_server
from agentflow.listening import end_is_asked_for, is_secret, listen, make_token, serving
from agentflow.runs import Notify
from agentflow.runs.locations import StageName
from agentflow.tools import Bench

Item = SessionMessage | Exception
"""A message, or why a line is not one."""


class AnsweringStream(ObjectReceiveStream[Item]):
    """The messages of a client. Each line that is not one is answered with an error."""

    def __init__(self, incoming: Any, outgoing: Any) -> None:
        """Read from a stream of items, and answer through a stream of messages."""
        self._incoming, self._outgoing = incoming, outgoing

    async def receive(self) -> Item:
        """The next message.

        Raises:
            anyio.EndOfStream: The client has closed its end.
        """
        item: Item = await self._incoming.receive()
        while isinstance(item, ValidationError):
            if not _is_blank(item):
                await self._outgoing.send(SessionMessage(answer_to(item)))
            item = await self._incoming.receive()
        return item

    async def aclose(self) -> None:
        """Close the stream of items."""
        await self._incoming.aclose()


def answer_to(error: ValidationError) -> types.JSONRPCError:
    """The error for a line, with the line's id where it has one."""
    faults = error.errors(include_url=False)
    given = [_object(fault["input"]) for fault in faults]
    line = next((item for item in given if "jsonrpc" in item), {})
    number = line.get("id")
    known = isinstance(number, int | str) and not isinstance(number, bool)
    is_json = faults[0]["type"] != "json_invalid"
    code = types.INVALID_REQUEST if is_json else types.PARSE_ERROR
    told = f"this line is not a JSON-RPC message: {faults[0]['msg']}"
    return types.JSONRPCError(
        jsonrpc="2.0", id=number if known else None, error=types.ErrorData(code=code, message=told)
    )


def _is_blank(error: ValidationError) -> bool:
    given = error.errors(include_url=False)[0]["input"]
    return isinstance(given, str | bytes) and not given.strip()


def _object(given: object) -> dict[str, Any]:
    """Data that may be an object, or its text, which may hold what a strict reader refuses."""
    if isinstance(given, str | bytes):
        try:
            given = json.loads(given)
        except (ValueError, RecursionError):
            return {}
    return given if isinstance(given, dict) else {}


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
