"""The studio: its page, and its API over what belongs to one folder, on a port until Ctrl-C."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from socket import socket
from zlib import crc32

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from agentflow.errors import UsageError
from agentflow.files.templates import fill
from agentflow.listening import end_is_asked_for, listen, serving
from agentflow.report.page import read_bundle
from agentflow.studio.answers import Nothing
from agentflow.studio.building.person_runs import PersonRuns
from agentflow.studio.building.routes import Building
from agentflow.studio.folder import RunFolder
from agentflow.studio.guard import Access, Guard, Refusal, RequestLimits, reads_pages, told
from agentflow.studio.sessions.recorder import SessionRecorder
from agentflow.studio.sessions.routes import Sessions
from agentflow.studio.simulations import Simulations
from agentflow.studio.watching.designs import Designs
from agentflow.studio.watching.routes import Watching

MOST = 64
"""Most connections at a time."""
FIRST_PORT, PORTS = 20_000, 10_000
"""Ports of studios that are given none; systems hand out higher ones to other programs."""
FILES = {"/studio.js": "text/javascript", "/studio.css": "text/css"}


def serve(runs: Path, port: int | None, say: Callable[[str], None]) -> None:
    """Serve the runs of a folder and say at which address.

    Raises:
        UsageError: The port cannot be listened on.
    """

    async def serve_until_asked() -> None:
        async with running(runs, port) as address:
            say(address)
            await end_is_asked_for()

    with suppress(KeyboardInterrupt):  # a second Ctrl-C
        asyncio.run(serve_until_asked())


@asynccontextmanager
async def running(
    runs: Path, port: int | None = 0, limits: RequestLimits | None = None
) -> AsyncIterator[str]:
    """Serve while the context is open; the address that opens the studio once.

    Without a port it is the same one each time for a folder, if it is free: what browsers keep of
    the Build page belongs to the port.
    """
    listening = _listen(runs, port)
    access = Access(listening.getsockname()[1])
    async with (
        _open_app(runs) as app,
        serving(Guard(app, access, limits or RequestLimits()), listening, MOST),
    ):
        yield access.address


def _listen(runs: Path, port: int | None) -> socket:
    if port is None:
        usual = FIRST_PORT + crc32(str(runs.resolve()).encode()) % PORTS
        with suppress(UsageError):
            return listen("127.0.0.1", usual, "")
    return listen("127.0.0.1", port or 0, "; choose another --port")


@asynccontextmanager
async def _open_app(runs: Path) -> AsyncIterator[Starlette]:
    """The application for a folder of runs; leaving the context ends everything that was
    started."""
    routes = _page_routes()  # first: says what to do if the page is missing
    folder = RunFolder(runs)
    async with (
        Simulations() as simulations,
        Designs.open(folder) as designs,
        PersonRuns(folder, simulations) as person_runs,
    ):
        with SessionRecorder(runs) as recorder:
            watching = Watching(folder, designs, simulations)
            routes += watching.routes
            routes += Building(folder, person_runs, simulations).routes
            routes += Sessions(recorder, simulations).routes
            first = asyncio.create_task(watching.start(Nothing()))  # slow the first time
            yield Starlette(routes=routes, exception_handlers=PLAIN)
            await first


async def _not_found(request: Request, error: Exception) -> Response:
    status, path = getattr(error, "status_code", 500), request.url.path
    if status == 404 and not path.startswith("/api/") and reads_pages(request.scope):
        page = fill("agentflow.studio", "page.html")  # its script says what is missing
        return Response(page, status, media_type="text/html")
    words = {404: "there is nothing at this address", 405: "this address has another method"}
    return told(Refusal(status, words.get(status, "the studio failed; its terminal shows more")))


PLAIN = {404: _not_found, 405: _not_found, 500: _not_found}


def _page_routes() -> list[BaseRoute]:
    def serve(path: str, content: str, kind: str) -> Route:
        async def respond(_request: Request) -> Response:
            return Response(content, media_type=kind)

        return Route(path, respond, methods=["GET"])

    return [
        serve("/", fill("agentflow.studio", "page.html"), "text/html"),
        *(serve(path, read_bundle(path[1:]), kind) for path, kind in FILES.items()),
    ]
