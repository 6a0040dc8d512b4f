"""Stack clients: `budget(record(limit(retry(http))))`, and check an endpoint with one small
request."""

import random
from collections.abc import Callable, Mapping

from pydantic import BaseModel

from agentflow.errors import (
    EndpointError,
    ModelNotFoundError,
    SilentError,
    UnauthorisedError,
    UnreachableError,
)
from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.messages import Client, Reply, Request
from agentflow.llm.settings import EndpointSettings, HttpSettings
from agentflow.llm.wrappers.budget import Budget, BudgetClient, Price
from agentflow.llm.wrappers.limits import LimitedClient, Limiter, RateLimits, RetryClient
from agentflow.llm.wrappers.record import CallLog, RecordingClient


def open_client(
    endpoint: Endpoint,
    settings: EndpointSettings | None = None,
    limits: RateLimits | None = None,
    *,
    warn: Callable[[str], None],
    on_wait: Callable[[str], None] = lambda _line: None,
) -> Client:
    """Open a client for one model of an OpenAI-compatible endpoint, with retries and rate limits.

    Args:
        endpoint: Model, base URL and API key.
        settings: Time-outs, retries, rate limits.
        limits: Shared by all clients of this endpoint; None makes them from the settings.
        warn: Called with one line for each parameter that the endpoint does not support.
        on_wait: Called with one line before each retry.

    Raises:
        ConfigError: The environment's proxy or certificate settings are invalid.
    """
    settings = settings or EndpointSettings()
    http = OpenAIClient(endpoint, settings.http, warn)
    retry = RetryClient(http, settings.retry, random.Random(), on_wait)
    return LimitedClient(retry, limits or Limiter(settings.limits))


def wrap(inner: Client, *, call_log: CallLog, budget: Budget, price: Price | None = None) -> Client:
    """Wrap any client (HTTP, procedural or scripted) in the call log and the budget.

    Args:
        inner: The client.
        call_log: Record of its calls; the caller closes it.
        budget: Shared by all clients of the run.
        price: Price of this model; None if unknown.
    """
    recorded = RecordingClient(inner, call_log)
    return BudgetClient(recorded, budget, price, recorded.holds)


UNUSABLE = {
    "empty": "the reply has no text: if the model reasons, its server may return only the "
    "reasoning; else its chat template may not fit the model; change the server's settings or the "
    "model",
    "tool_calls": "the reply has only tool calls, but agentflow reads text: switch off tool "
    "calling at the server, or use another model",
    "length": "the reply was cut off at {tokens} tokens: use a model that reasons less, or raise "
    "the server's limit of output tokens",
    "no_tool_call": "the reply calls no tool, although the prompt asked for it: the server may "
    "ignore "
    "tools; switch on tool calling at the server, or use another model, or a workflow without "
    "tools",
    "content_filter": "the endpoint filtered the reply: use another model or endpoint",
}
"""Why a reply has no answer -> what it means and how to fix it."""


class EndpointDiagnosis(BaseModel, frozen=True):
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
    reply: str = ""
    """Text of the reply, or the arguments of its tool call."""
    problem: str = ""
    """Why there is no usable reply, and how to fix it, in one line; empty on success."""


async def diagnose(
    endpoint: Endpoint, settings: HttpSettings, question: Request
) -> EndpointDiagnosis:
    """Send one request without retries and report what the endpoint does."""
    client = OpenAIClient(endpoint, settings, warn=lambda _line: None)
    try:
        reply = await client.complete(question)
    except EndpointError as problem:
        error = problem.error if isinstance(problem, TransientFault) else problem
        return _diagnose_error(endpoint, error, client.unsupported.actions)
    finally:
        await client.aclose()
    return EndpointDiagnosis(
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
        reply=reply.tool_calls[0].arguments if question.tools and reply.tool_calls else reply.text,
        problem=_problem_of(endpoint, reply, question),
    )


def _problem_of(endpoint: Endpoint, reply: Reply, question: Request) -> str:
    finish: str = reply.finish
    if question.tools and finish in ("stop", "tool_calls"):
        finish = "stop" if reply.tool_calls else "no_tool_call"
    if finish == "stop":
        return ""
    meaning = UNUSABLE[finish].format(tokens=question.sampling.max_tokens)
    return f"{endpoint.base_url}, model {endpoint.model!r}: {meaning}"


def _diagnose_error(
    endpoint: Endpoint, error: EndpointError, refused: Mapping[str, str]
) -> EndpointDiagnosis:
    missing = isinstance(error, ModelNotFoundError)
    return EndpointDiagnosis(
        model=endpoint.model,
        base_url=endpoint.base_url,
        reachable=isinstance(error, SilentError) or not isinstance(error, UnreachableError),
        authorised=False if isinstance(error, UnauthorisedError) else (True if missing else None),
        model_exists=False if missing else None,
        refused=refused,
        problem=str(error),
    )
