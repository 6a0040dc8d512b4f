"""The studio as a web application: its page, and its API over what belongs to one folder."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from agentflow.report.page import read_bundle
from agentflow.studio.answers import told
from agentflow.studio.building.routes import Building
from agentflow.studio.building.workshop import Workshop
from agentflow.studio.folder import RunFolder
from agentflow.studio.guard import Refusal
from agentflow.studio.sessions.recorder import Recorder
from agentflow.studio.sessions.routes import Sessions
from agentflow.studio.simulations import Simulations
from agentflow.studio.watching.designs import Designs
from agentflow.studio.watching.routes import Watching

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>agentflow studio</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="/studio.css">
<script src="/studio.js" defer></script>
</head>
<body><noscript>The studio needs JavaScript.</noscript></body>
</html>
"""
FILES = {"/studio.js": "text/javascript", "/studio.css": "text/css"}


@dataclass(frozen=True)
class Studio:
    """What one server works with."""

    watching: Watching
    building: Building
    sessions: Sessions

    @classmethod
    @asynccontextmanager
    async def open(cls, runs: Path) -> AsyncIterator[Studio]:
        """Prepare for a folder of runs; leaving the context ends everything that was begun."""
        for name in FILES:
            read_bundle(name[1:])  # says what to do if it is missing
        folder = RunFolder(runs)
        async with (
            Simulations() as simulations,
            Designs.open(folder) as designs,
            Workshop(folder, simulations) as workshop,
        ):
            with Recorder(runs) as recorder:
                yield cls(
                    Watching(folder, designs, simulations),
                    Building(folder, workshop, simulations),
                    Sessions(recorder),
                )


def build_app(studio: Studio) -> Starlette:
    """The application of a studio."""
    return Starlette(
        routes=[
            *_page_routes(),
            *studio.watching.routes,
            *studio.building.routes,
            *studio.sessions.routes,
        ],
        exception_handlers=PLAIN,
    )


async def _not_found(_request: Request, error: Exception) -> Response:
    status = getattr(error, "status_code", 500)
    words = {404: "there is nothing at this address", 405: "this address has another method"}
    return told(Refusal(status, words.get(status, "the studio failed; its terminal tells more")))


PLAIN = {404: _not_found, 405: _not_found, 500: _not_found}


def _page_routes() -> list[BaseRoute]:
    def serve(path: str, content: str, kind: str) -> Route:
        async def respond(_request: Request) -> Response:
            return Response(content, media_type=kind)

        return Route(path, respond, methods=["GET"])

    return [
        serve("/", PAGE, "text/html"),
        *(serve(path, read_bundle(path[1:]), kind) for path, kind in FILES.items()),
    ]
