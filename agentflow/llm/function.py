"""A Python function as a model."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from inspect import isawaitable

from agentflow.llm.messages import Reply, Request

ModelFunction = Callable[[Request], "str | Reply | Awaitable[str | Reply]"]
"""Answers a request with a text, or with a `Reply` that includes usage. Plain functions are called
in threads, several at a time; coroutine functions run on the event loop."""


class FunctionClient:
    """A client that calls a model function."""

    def __init__(
        self, answer: ModelFunction, name: str, run: str = "", seed: int | None = None
    ) -> None:
        """`name` is the model's name in results and in the record.

        `run` and `seed` are those of the run, for the function.
        """
        self._answer, self.name = answer, name
        self._of = {"run": run, "run_seed": seed}

    def of_run(self, run: str, seed: int) -> FunctionClient:
        """The same function, which knows for which run it answers."""
        return FunctionClient(self._answer, self.name, run, seed)

    async def complete(self, request: Request) -> Reply:
        """Answer one request; exceptions of the function propagate."""
        given = await asyncio.to_thread(self._answer, request.model_copy(update=self._of))
        answer = await given if isawaitable(given) else given
        if isinstance(answer, Reply):
            return answer
        if not isinstance(answer, str):
            raise TypeError(
                f"the model function must return a string or a Reply, not {answer!r:.80}"
            )
        finish = "stop" if answer.strip() else "empty"
        return Reply(text=answer, finish=finish, model=self.name)

    async def aclose(self) -> None:
        """Nothing to release."""
