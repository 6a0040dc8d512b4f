"""Retry calls after temporary failures."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable

from tenacity import AsyncRetrying, RetryCallState, retry_if_exception_type, stop_after_attempt

from agentflow.llm.client import Client, ClientWrapper
from agentflow.llm.endpoint.faults import TransientFault
from agentflow.llm.messages import Reply, Request
from agentflow.llm.settings import RetrySettings


class RetryClient(ClientWrapper):
    """Retries calls that fail with a `TransientFault`; other errors are raised immediately.

    Args:
        inner: The client whose calls are retried.
        settings: Number of attempts and waiting times.
        rng: Random generator for the jitter; does not affect results.
        on_wait: Called with one line of text before each wait.
    """

    def __init__(
        self,
        inner: Client,
        settings: RetrySettings,
        rng: random.Random,
        on_wait: Callable[[str], None] = lambda _line: None,
    ) -> None:
        super().__init__(inner)
        self._settings = settings
        self._rng = rng
        self._on_wait = on_wait

    async def complete(self, request: Request) -> Reply:
        """Answer one request; `Reply.retries` counts the retries.

        Raises:
            EndpointError: The last attempt failed, or one failed permanently.
        """
        retrying = AsyncRetrying(
            sleep=asyncio.sleep,
            stop=stop_after_attempt(self._settings.attempts),
            wait=self._wait_s,
            retry=retry_if_exception_type(TransientFault),
            before_sleep=self._report_wait,
            reraise=True,
        )
        try:
            reply: Reply = await retrying(self._inner.complete, request)
        except TransientFault as fault:
            raise fault.final_error(self._settings.attempts) from None
        retries = int(retrying.statistics.get("attempt_number", 1)) - 1
        return reply.model_copy(update={"retries": retries}) if retries else reply

    def _wait_s(self, state: RetryCallState) -> float:
        fault = state.outcome.exception() if state.outcome else None
        if isinstance(fault, TransientFault) and fault.retry_after_s is not None:
            return min(fault.retry_after_s, self._settings.retry_after_cap_s)
        exponent = min(state.attempt_number - 1, 30)
        longest = min(self._settings.cap_s, self._settings.base_s * 2**exponent)
        return self._rng.uniform(0.0, longest)

    def _report_wait(self, state: RetryCallState) -> None:
        fault = state.outcome.exception() if state.outcome else None
        wait = state.next_action.sleep if state.next_action else 0.0
        request: Request = state.args[0]
        self._on_wait(f"{request.label}: {fault}; retrying in {wait:.1f} s")
