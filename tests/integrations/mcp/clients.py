"""Clients of the SDK, and servers that they start or connect to."""

from __future__ import annotations

import asyncio
import re
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx2
from mcp import Client, StdioServerParameters, types
from mcp.client.stdio import stdio_client
from mcp.client.streamable_http import streamable_http_client

from agentflow.integrations.mcp.addresses import read_token
from agentflow.integrations.mcp.serving import Served

ROOT = Path(__file__).parents[3]
MAIN = "import sys; from agentflow.cli import main; sys.exit(main())"
ENVIRONMENT = {"PYTHONPATH": str(ROOT)}
CAR = (ROOT / "examples" / "car.json").read_text(encoding="utf-8")
CLIENT = types.Implementation(name="test", version="1")


def command(*options: str) -> list[str]:
    """The command line of a server on the task movement."""
    return [sys.executable, "-c", MAIN, "mcp", "--task", "movement", *options]


@asynccontextmanager
async def stdio_session(
    folder: Path, *options: str, **settings: Any
) -> AsyncIterator[tuple[Client, Path]]:
    """A client of a server that it started, and the file with the server's stderr."""
    program, *arguments = command("--out", str(folder / "runs"), *options)
    log = folder / "stderr.txt"
    parameters = StdioServerParameters(command=program, args=arguments, env=ENVIRONMENT)
    with log.open("w") as errors:
        transport = stdio_client(parameters, errlog=errors)
        async with Client(
            transport, read_timeout_seconds=120, client_info=CLIENT, **settings
        ) as it:
            yield it, log


@asynccontextmanager
async def http_server(folder: Path, *options: str) -> AsyncIterator[tuple[Served, Process]]:
    """A server over HTTP on a free port, with its token and its process."""
    token_file = folder / "token"
    arguments = ["--http", "127.0.0.1:0", "--token-file", str(token_file), *options]
    process = await asyncio.create_subprocess_exec(
        *command("--out", str(folder / "runs"), *arguments),
        env=ENVIRONMENT,
        stdin=DEVNULL,
        stderr=PIPE,
    )
    assert process.stderr is not None
    try:
        line = (await process.stderr.readline()).decode()
        found = re.match(r"agentflow: listening on (\S+); Ctrl-C ends it", line)
        assert found, line
        draining = asyncio.create_task(process.stderr.read())
        yield Served(found[1], read_token(token_file)), process
    finally:
        if process.returncode is None:
            process.terminate()
        await process.wait()
    assert process.returncode in (0, -signal.SIGKILL)
    told = (await draining).decode()
    assert "Traceback" not in told, told


@asynccontextmanager
async def http_client(url: str, token: str, **options: Any) -> AsyncIterator[Client]:
    """A connected client that sends a bearer token."""
    headers = {"Authorization": f"Bearer {token}"}
    async with httpx2.AsyncClient(headers=headers, timeout=600) as http:
        transport = streamable_http_client(url, http_client=http)
        settings = {"client_info": CLIENT, "read_timeout_seconds": 120, **options}
        async with Client(transport, **settings) as client:
            yield client


def text_of(result: types.CallToolResult) -> str:
    """The first text of an answer."""
    first = result.content[0]
    assert isinstance(first, types.TextContent)
    return first.text


def data_of(result: types.CallToolResult) -> dict[str, Any]:
    """The data of an answer."""
    assert isinstance(result.structured_content, dict)
    return result.structured_content


def only_run(folder: Path) -> Path:
    """The only run directory below a folder."""
    (run,) = (folder / "runs").iterdir()
    return run
