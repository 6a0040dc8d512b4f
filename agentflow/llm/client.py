"""The interface that every model implements, and the base of wrapping clients."""

from __future__ import annotations

from typing import Protocol

from agentflow.llm.messages import Reply, Request


class Client(Protocol):
    """Answers requests; safe to call concurrently from one event loop."""

    @property
    def name(self) -> str:
        """Model name shown in results, for instance `procedural (no language model)`."""

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            EndpointError: The endpoint cannot be used.
            BudgetSpentError: A call, token or cost limit is reached.
            ReplayMissError: The request was not recorded (replay only).
        """

    async def aclose(self) -> None:
        """Release connections and files; the client cannot be used afterwards."""


class ClientWrapper:
    """Base of clients that wrap another client."""

    def __init__(self, inner: Client) -> None:
        self._inner = inner
        self.name = inner.name

    async def aclose(self) -> None:
        """Close the inner client."""
        await self._inner.aclose()
