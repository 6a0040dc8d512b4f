"""Check an endpoint with one small request."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel

from agentflow.errors import EndpointError, ModelNotFoundError, UnauthorisedError, UnreachableError
from agentflow.llm.endpoint.address import Endpoint
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.messages import JsonSchema, Message, Request, Sampling
from agentflow.llm.settings import HttpSettings

_FORM = JsonSchema(
    name="answer",
    content={
        "type": "object",
        "properties": {"ok": {"type": "boolean"}},
        "required": ["ok"],
        "additionalProperties": False,
    },
)
_QUESTION = Request(
    role="doctor",
    label="doctor",
    messages=(Message(role="user", text='Reply with the JSON object {"ok": true}.'),),
    sampling=Sampling(max_tokens=256, seed=1, stop=("###",), response_format=_FORM),
)
"""Uses every optional parameter, to find the unsupported ones."""


class Diagnosis(BaseModel, frozen=True):
    """What one request reveals about an endpoint; None is unknown."""

    model: str
    base_url: str
    reachable: bool
    authorised: bool | None = None
    model_exists: bool | None = None
    streaming: bool | None = None
    refused: Mapping[str, str] = {}
    """Unsupported parameter -> what is done instead."""
    usage: bool | None = None
    """Whether token counts are returned."""
    reasoning: bool | None = None
    """Whether reasoning text is returned."""
    answered_as: str = ""
    """Model name in the answer."""
    latency_s: float | None = None
    problem: str = ""
    """Why there is no reply, in one line; empty on success."""


async def diagnose(endpoint: Endpoint, settings: HttpSettings) -> Diagnosis:
    """Send one small request without retries and report what the endpoint does."""
    client = OpenAIClient(endpoint, settings, warn=lambda _line: None)
    try:
        reply = await client.complete(_QUESTION)
    except EndpointError as problem:
        error = problem.error if isinstance(problem, TransientFault) else problem
        return _diagnose_error(endpoint, error, client.unsupported.actions)
    finally:
        await client.aclose()
    return Diagnosis(
        model=endpoint.model,
        base_url=endpoint.base_url,
        reachable=True,
        authorised=True,
        model_exists=True,
        streaming=client.streams,
        refused=client.unsupported.actions,
        usage=reply.usage.total > 0,
        reasoning=bool(reply.reasoning or reply.usage.reasoning),
        answered_as=reply.model,
        latency_s=reply.latency_s,
    )


def _diagnose_error(
    endpoint: Endpoint, error: EndpointError, refused: Mapping[str, str]
) -> Diagnosis:
    missing = isinstance(error, ModelNotFoundError)
    return Diagnosis(
        model=endpoint.model,
        base_url=endpoint.base_url,
        reachable=not isinstance(error, UnreachableError),
        authorised=False if isinstance(error, UnauthorisedError) else (True if missing else None),
        model_exists=False if missing else None,
        refused=refused,
        problem=str(error),
    )
