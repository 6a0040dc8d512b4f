"""A client with scripted replies."""

from collections.abc import Callable, Sequence

from agentflow.errors import UsageError
from agentflow.llm.messages import Reply, Request


class ScriptedClient:
    """Replies from a list, in order, or from a function of the request.

    Args:
        replies: Texts or replies; a list provides one per call.
        name: Model name shown in results.
    """

    def __init__(
        self,
        replies: Sequence[str | Reply] | Callable[[Request], str | Reply],
        name: str = "scripted",
    ) -> None:
        self._replies = replies
        self.name = name
        self.requests: list[Request] = []

    async def complete(self, request: Request) -> Reply:
        """Answer one request.

        Raises:
            UsageError: The list has no replies left.
        """
        self.requests.append(request)
        reply = self._replies(request) if callable(self._replies) else self._next(self._replies)
        if isinstance(reply, Reply):
            return reply
        return Reply(text=reply, finish="stop" if reply.strip() else "empty", model=self.name)

    async def aclose(self) -> None:
        """Nothing to release."""

    def _next(self, replies: Sequence[str | Reply]) -> str | Reply:
        asked = len(self.requests)
        if asked > len(replies):
            raise UsageError(
                f"the script has {len(replies)} replies, "
                f"but call {asked} ({self.requests[-1].label}) needs another"
            )
        return replies[asked - 1]
