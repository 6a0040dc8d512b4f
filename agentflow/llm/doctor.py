"""Check an endpoint with one small request."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict

from agentflow.errors import (
    EndpointError,
    ModelNotFoundError,
    UnauthorisedError,
    UnreachableError,
)
from agentflow.llm.endpoint.address import Endpoint
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.messages import JsonSchema, Message, Reply, Request, Sampling
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
"""Uses every optional parameter, so that unsupported ones show up."""


class Diagnosis(BaseModel):
    """What one request reveals about an endpoint; None is unknown."""

    model_config = ConfigDict(frozen=True)

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
        outcome: Reply | EndpointError = await client.complete(_QUESTION)
    except TransientFault as fault:
        outcome = fault.error
    except EndpointError as error:
        outcome = error
    finally:
        await client.aclose()
    refused = dict(client.unsupported.actions)
    if isinstance(outcome, EndpointError):
        return _diagnose_error(endpoint, outcome, refused)
    return Diagnosis(
        model=endpoint.model,
        base_url=endpoint.base_url,
        reachable=True,
        authorised=True,
        model_exists=True,
        streaming=client.streams,
        refused=refused,
        usage=outcome.usage.total > 0,
        reasoning=bool(outcome.reasoning or outcome.usage.reasoning),
        answered_as=outcome.model,
        latency_s=outcome.latency_s,
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
