"""What the server refuses over HTTP before a session exists."""

from __future__ import annotations

import json
import logging
import socket
from typing import Any

import httpx
import pytest
from mcp.shared.exceptions import MCPError

from agentflow.integrations.mcp.addresses import HttpAddress
from agentflow.integrations.mcp.server import OneBench, build_server
from agentflow.integrations.mcp.serving import Served, serve_bench, serve_http
from agentflow.listening import make_token
from tests.integrations.mcp.clients import http_client
from tests.tools.benches import open_bench

HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {
        "protocolVersion": "2025-11-25",
        "capabilities": {},
        "clientInfo": {"name": "raw", "version": "1"},
    },
}


async def post(served: Served, content: bytes | None = None, **headers: str | bytes | None) -> Any:
    """Post a greeting, or other content, with the right headers except for those given."""
    sent: dict[str, str | bytes | None] = {
        "Authorization": f"Bearer {served.token}",
        "Accept": "application/json, text/event-stream",
        "Content-Type": "application/json",
        **{name.replace("_", "-"): value for name, value in headers.items()},
    }
    given = {name: value for name, value in sent.items() if value is not None}
    content = json.dumps(HELLO).encode() if content is None else content
    async with httpx.AsyncClient() as http:
        return await http.post(served.url, content=content, headers=given)


@pytest.mark.slow
async def test_needs_the_token_and_names_of_this_machine(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.DEBUG)
    async with open_bench() as (bench, _), serve_bench(bench) as served:
        port = served.url.split(":")[2].partition("/")[0]
        assert (await post(served)).status_code == 200
        for status, headers in (
            (401, {"Authorization": None}),
            (401, {"Authorization": "Bearer"}),
            (401, {"Authorization": "Bearer " + served.token[:-1]}),
            (401, {"Authorization": "Bearer " + served.token + "x"}),
            (401, {"Authorization": b"Bearer " + b"\xfc" * 43}),
            (401, {"Authorization": "Basic " + served.token}),
            (421, {"Host": f"evil.example:{port}"}),
            (421, {"Host": "127.0.0.1:1"}),
            (200, {"Host": f"localhost:{port}"}),
            (403, {"Origin": "http://evil.example"}),
            (403, {"Origin": "null"}),
            (200, {"Origin": "http://localhost:6274"}),
            (400, {"Content-Type": "text/plain"}),
            (406, {"Accept": "text/html"}),
        ):
            answer = await post(served, **headers)  # type: ignore[arg-type]
            assert answer.status_code == status, (headers, answer.text)
            assert served.token not in answer.text
        assert served.token not in caplog.text


@pytest.mark.slow
async def test_refuses_too_much_and_what_is_not_json() -> None:
    async with open_bench() as (bench, _), serve_bench(bench) as served:
        assert (await post(served, b"x" * (4 * 1024 * 1024 + 1))).status_code == 413
        for content in (b"", b"{", b"[" * 100_000, b"\xff\xfe", b'{"jsonrpc": "2.0"}', b"9" * 5000):
            answer = await post(served, content)
            assert answer.status_code == 400
            assert answer.json()["error"]["message"]
            assert "Traceback" not in answer.text
        assert (await post(served)).status_code == 200


@pytest.mark.slow
async def test_beyond_loopback_it_answers_to_names_of_this_machine_with_the_token() -> None:
    async with open_bench() as (bench, _):
        server = build_server(lambda _client: OneBench(bench))
        token = make_token()
        async with serve_http(server, HttpAddress("0.0.0.0", 0), token) as url:
            host = url.removeprefix("http://").removesuffix("/mcp")
            assert host.startswith(f"{socket.gethostname()}:")
            local = Served(f"http://127.0.0.1:{host.rpartition(':')[2]}/mcp", token)
            assert (await post(local)).status_code == 200
            assert (await post(local, Host=host)).status_code == 200
            assert (await post(local, Host="evil.example")).status_code == 421
            assert (await post(local, Authorization=None)).status_code == 401


@pytest.mark.slow
async def test_an_unknown_session_is_not_found() -> None:
    async with open_bench() as (bench, _), serve_bench(bench) as served:
        answer = await post(served, Mcp_Session_Id="0123456789abcdef")
        assert answer.status_code == 404
        assert answer.json()["error"]["message"] == "Session not found"


@pytest.mark.slow
async def test_clients_of_a_revision_without_sessions_fall_back_or_are_told() -> None:
    async with open_bench() as (bench, _), serve_bench(bench) as served:
        async with http_client(served.url, served.token) as client:
            assert client.protocol_version == "2025-11-25"
        async with http_client(served.url, served.token, mode="2026-07-28") as client:
            with pytest.raises(MCPError, match="a bench needs a session; connect with"):
                await client.list_tools()


async def test_the_port_is_free_again_afterwards() -> None:
    async with open_bench() as (bench, _):
        async with serve_bench(bench) as served:
            pass
        with pytest.raises(httpx.ConnectError):
            await post(served)
