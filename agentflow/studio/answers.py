"""Routes of the API: typed arguments in, JSON out, errors in words."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from agentflow.errors import AgentflowError
from agentflow.studio.folder import LONGEST
from agentflow.studio.guard import Refusal, told

DEEPEST = 12
"""Deepest nesting of JSON that is sent here; machines need 3."""


Name = Annotated[str, Field(max_length=LONGEST)]
"""Of a run, a sweep or a session."""
Hash = Annotated[str, Field(pattern="^[0-9a-f]{16}$")]
"""Of the content of a machine."""


class Arguments(BaseModel):
    """What a request says: query parameters of GET, or the JSON body of POST."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Nothing(Arguments):
    """No arguments."""


class OneRun(Arguments):
    """A run by name."""

    run: Name


Given = TypeVar("Given", bound=Arguments)


def get(path: str, kind: type[Given], answer: Callable[[Given], Awaitable[Any]]) -> Route:
    """A route that reads; its arguments are texts."""

    async def respond(request: Request) -> Response:
        return await _respond(kind, dict(request.query_params), answer)

    return Route(path, respond, methods=["GET"])


def post(path: str, kind: type[Given], answer: Callable[[Given], Awaitable[Any]]) -> Route:
    """A route that acts; its arguments are a JSON object."""

    async def respond(request: Request) -> Response:
        if request.headers.get("content-type", "").partition(";")[0] != "application/json":
            return told(Refusal(415, "the body must be JSON: send content-type application/json"))
        try:
            given = json.loads(await request.body())
        except (ValueError, RecursionError):
            return told(Refusal(400, "the body is not JSON"))
        return await _respond(kind, given, answer)

    return Route(path, respond, methods=["POST"])


async def _respond(
    kind: type[Given], given: object, answer: Callable[[Given], Awaitable[Any]]
) -> Response:
    try:
        arguments = kind.model_validate(_shallow(given))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))[:80] or "the body"
        return told(Refusal(400, f"{where}: {first['msg']}"))
    except Refusal as refusal:
        return told(refusal)
    try:
        found = await answer(arguments)
        if isinstance(found, Response):
            return found
        content = json.dumps(found, allow_nan=False, separators=(",", ":"))
        return Response(content, media_type="application/json")
    except Refusal as refusal:
        return told(refusal)
    except AgentflowError as error:
        return told(Refusal(400, str(error)))
    except asyncio.CancelledError:  # the studio ends; what reaches the server would be a traceback
        return told(Refusal(503, "the studio has ended"))


def _shallow(value: Any, depth: int = 0) -> Any:
    """Data that is not nested deeply."""
    if depth > DEEPEST:
        raise Refusal(400, f"the body is nested more than {DEEPEST} deep; send flatter data")
    if isinstance(value, dict):
        return {key: _shallow(item, depth + 1) for key, item in value.items()}
    return [_shallow(item, depth + 1) for item in value] if isinstance(value, list) else value
