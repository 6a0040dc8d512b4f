"""Owns the client around a model function of the user's own."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from inspect import isawaitable

from agentflow.llm.messages import Reply, Request

ModelFunction = Callable[[Request], "str | Reply | Awaitable[str | Reply]"]
"""Answers a request: a text, or a reply with usage. A plain function is called in threads, several
at a time; a coroutine function on the event loop."""


class FunctionClient:
    """A model function as a client."""

    def __init__(self, answer: ModelFunction, name: str) -> None:
        """`name` is shown in results and kept in the record."""
        self._answer, self._name = answer, name

    @property
    def name(self) -> str:
        """The model's name."""
        return self._name

    async def complete(self, request: Request) -> Reply:
        """Answer one request; what the function raises is passed on."""
        given = await asyncio.to_thread(self._answer, request)
        said = await given if isawaitable(given) else given
        if isinstance(said, Reply):
            return said
        if not isinstance(said, str):
            raise TypeError(f"the model function must give a text or a Reply, not {said!r:.80}")
        return Reply(text=said, finish="stop" if said.strip() else "empty", model=self._name)

    async def aclose(self) -> None:
        """Nothing to release."""
