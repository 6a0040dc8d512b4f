"""Stack clients: `budget(record(limit(retry(http))))`."""

from __future__ import annotations

import random
from collections.abc import Callable

from agentflow.llm.client import Client
from agentflow.llm.endpoint.address import Endpoint
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.settings import EndpointSettings
from agentflow.llm.wrappers.budget import Budget, BudgetClient, Price
from agentflow.llm.wrappers.call_log import CallLog
from agentflow.llm.wrappers.limits import LimitedClient, Limiter, RateLimits
from agentflow.llm.wrappers.record import RecordingClient
from agentflow.llm.wrappers.retry import RetryClient


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


def wrap(
    inner: Client,
    *,
    call_log: CallLog | None = None,
    budget: Budget | None = None,
    price: Price | None = None,
) -> Client:
    """Wrap any client (HTTP, procedural or scripted) in the call log and the budget.

    Args:
        inner: The client.
        call_log: Record of its calls; the caller closes it.
        budget: Shared by all clients of the run.
        price: Price of this model; None if unknown.
    """
    if call_log is None:
        return BudgetClient(inner, budget, price) if budget is not None else inner
    recorded = RecordingClient(inner, call_log)
    if budget is None:
        return recorded
    return BudgetClient(recorded, budget, price, recorded.holds)
