"""Owns repetition after failures that may pass: how often, and how long to wait in between."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable

from tenacity import AsyncRetrying, RetryCallState, retry_if_exception_type, stop_after_attempt

from agentflow.llm.client import Client
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.messages import Reply, Request
from agentflow.llm.settings import RetrySettings


class RetryClient:
    """Repeats calls that fail with a `TransientFault`; every other error passes at once.

    Args:
        inner: The client whose calls are repeated.
        settings: How often and how long.
        rng: Draws the jitter; no result depends on it.
        on_wait: Called before each wait with one line of text.
    """

    def __init__(
        self,
        inner: Client,
        settings: RetrySettings,
        rng: random.Random,
        on_wait: Callable[[str], None] = lambda _line: None,
    ) -> None:
        self._inner = inner
        self._settings = settings
        self._rng = rng
        self._on_wait = on_wait

    @property
    def name(self) -> str:
        """The model's name."""
        return self._inner.name

    async def complete(self, request: Request) -> Reply:
        """Answer one request; `Reply.retries` counts the repetitions.

        Raises:
            EndpointError: The last attempt failed, or one failed for good.
        """
        retrying = AsyncRetrying(
            sleep=asyncio.sleep,
            stop=stop_after_attempt(self._settings.attempts),
            wait=self._wait_s,
            retry=retry_if_exception_type(TransientFault),
            before_sleep=self._announce,
            reraise=True,
        )
        try:
            reply: Reply = await retrying(self._inner.complete, request)
        except TransientFault as fault:
            raise fault.given_up(self._settings.attempts) from None
        repeated = int(retrying.statistics.get("attempt_number", 1)) - 1
        return reply.model_copy(update={"retries": repeated}) if repeated else reply

    async def aclose(self) -> None:
        """Close the inner client."""
        await self._inner.aclose()

    def _wait_s(self, state: RetryCallState) -> float:
        fault = state.outcome.exception() if state.outcome else None
        if isinstance(fault, TransientFault) and fault.retry_after_s is not None:
            return min(fault.retry_after_s, self._settings.retry_after_cap_s)
        exponent = min(state.attempt_number - 1, 30)
        longest = min(self._settings.cap_s, self._settings.base_s * 2**exponent)
        return self._rng.uniform(0.0, longest)

    def _announce(self, state: RetryCallState) -> None:
        fault = state.outcome.exception() if state.outcome else None
        wait = state.next_action.sleep if state.next_action else 0.0
        request: Request = state.args[0]
        self._on_wait(f"{request.label}: {fault}; again in {wait:.1f} s")
