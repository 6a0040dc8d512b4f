"""Helpers for making requests."""

from __future__ import annotations

from collections.abc import Callable

from agentflow.llm.endpoint.body import Endpoint
from agentflow.llm.endpoint.http import OpenAIClient
from agentflow.llm.messages import Message, Reply, Request, Sampling
from agentflow.llm.settings import HttpSettings

KEY = "sk-test-4f1c77d09a"


def ask(text: str = "hello", label: str = "a/1", **sampling: object) -> Request:
    """A request with one user message."""
    return Request(
        role="designer",
        label=label,
        messages=(Message(role="user", text=text),),
        sampling=Sampling.model_validate(sampling),
    )


def client_for(
    base_url: str,
    key: str | None = KEY,
    warn: Callable[[str], None] = lambda _line: None,
    **settings: float,
) -> OpenAIClient:
    """An unwrapped client of model m."""
    endpoint = Endpoint("m", base_url, key)
    return OpenAIClient(endpoint, HttpSettings.model_validate(settings), warn)


async def once(base_url: str, request: Request | None = None, **options: float) -> Reply:
    """One attempt with a new client."""
    client = client_for(base_url, **options)
    try:
        return await client.complete(request or ask())
    finally:
        await client.aclose()
