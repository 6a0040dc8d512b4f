"""Owns how clients are put around each other: `budget(tape(limit(retry(http))))` (spec 4.1).

Reads no environment and no files: names, keys and settings are given.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from agentflow.llm.client import Client
from agentflow.llm.endpoint.address import Endpoint
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.settings import EndpointSettings
from agentflow.llm.wrappers.budget import Budget, BudgetClient
from agentflow.llm.wrappers.limits import LimitedClient, Limiter
from agentflow.llm.wrappers.prices import Price
from agentflow.llm.wrappers.record import RecordingClient
from agentflow.llm.wrappers.retry import RetryClient
from agentflow.llm.wrappers.tape import Tape


def open_client(
    endpoint: Endpoint,
    *,
    settings: EndpointSettings | None = None,
    tape: Tape | None = None,
    budget: Budget | None = None,
    price: Price | None = None,
    limiter: Limiter | None = None,
    warn: Callable[[str], None],
    on_wait: Callable[[str], None] = lambda _line: None,
) -> Client:
    """A client for one model of an OpenAI-compatible endpoint, complete.

    Args:
        endpoint: Which model, where, and with which key.
        settings: Time limits, repetition, rate limits.
        tape: Record of the run's calls; its opener closes it.
        budget: Shared by all clients of the run.
        price: Of this model; None is unknown.
        limiter: Shared by all clients of this endpoint; None makes one of the settings.
        warn: Gets one line for each parameter that the endpoint turns out to refuse.
        on_wait: Gets one line for each wait before a repetition.

    Raises:
        ConfigError: The environment's proxy or certificate settings are unusable.
    """
    settings = settings or EndpointSettings()
    http = OpenAIClient(endpoint, settings.http, warn)
    retry = RetryClient(http, settings.retry, random.Random(), on_wait)
    limited = LimitedClient(retry, limiter or Limiter(settings.limits))
    return wrap(limited, tape=tape, budget=budget, price=price)


def wrap(
    inner: Client,
    *,
    tape: Tape | None = None,
    budget: Budget | None = None,
    price: Price | None = None,
) -> Client:
    """The record and the budget around any client (also a procedural or scripted one)."""
    if tape is None:
        return BudgetClient(inner, budget, price) if budget is not None else inner
    recorded = RecordingClient(inner, tape)
    if budget is None:
        return recorded
    return BudgetClient(recorded, budget, price, recorded.holds)
