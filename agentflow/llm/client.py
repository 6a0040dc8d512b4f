"""Owns the one interface behind which every model stands."""

from __future__ import annotations

from typing import Protocol

from agentflow.llm.messages import Reply, Request


class Client(Protocol):
    """Answers requests; safe to call concurrently from one event loop."""

    @property
    def name(self) -> str:
        """The model's name as shown in results, for instance `procedural (no language model)`."""

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            EndpointError: The endpoint cannot be used.
            BudgetSpentError: The budget has run out.
            ReplayMissError: A replaying client has no record of the request.
        """

    async def aclose(self) -> None:
        """Release connections and files; further calls are not allowed."""
