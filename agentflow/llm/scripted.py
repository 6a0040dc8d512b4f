"""Owns the client that answers by script: for tests, examples and dry runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from agentflow.errors import UsageError
from agentflow.llm.messages import Reply, Request


class ScriptedClient:
    """Answers from a list, in order, or from a function of the request.

    Args:
        replies: Texts or whole replies; a list is used up one per call.
        name: The model's name as shown in results.
    """

    def __init__(
        self,
        replies: Sequence[str | Reply] | Callable[[Request], str | Reply],
        name: str = "scripted",
    ) -> None:
        self._replies = replies
        self._name = name
        self.requests: list[Request] = []
        """What has been asked, in order."""

    @property
    def name(self) -> str:
        """The model's name."""
        return self._name

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            UsageError: The list is used up.
        """
        self.requests.append(request)
        given = self._next(request)
        if isinstance(given, Reply):
            return given
        return Reply(text=given, finish="stop" if given.strip() else "empty", model=self._name)

    async def aclose(self) -> None:
        """Nothing to release."""

    def _next(self, request: Request) -> str | Reply:
        if callable(self._replies):
            return self._replies(request)
        asked = len(self.requests)
        if asked > len(self._replies):
            raise UsageError(
                f"the script holds {len(self._replies)} replies; "
                f"call {asked} ({request.label}) has none"
            )
        return self._replies[asked - 1]
