"""Owns the conversation with an OpenAI-compatible endpoint over httpx: one attempt per call.

Repetition, limits, budgets and the record are clients around this one.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing
from dataclasses import replace

import httpx

from agentflow.errors import ConfigError, EndpointError
from agentflow.llm.endpoint import faults, wire
from agentflow.llm.endpoint.address import Endpoint
from agentflow.llm.endpoint.lanes import Lanes
from agentflow.llm.endpoint.quirks import Quirks
from agentflow.llm.endpoint.sse import Framing
from agentflow.llm.messages import Reply, Request
from agentflow.llm.settings import HttpSettings

_LARGEST_ANSWER = 64 * 2**20
_LARGEST_REFUSAL = 2**16
_DRAIN_S = 1.0
"""How long a stream may take to end after `[DONE]`, so that its connection can be used again."""


class OpenAIClient:
    """Asks one model of an OpenAI-compatible endpoint.

    Args:
        endpoint: Where requests go.
        settings: Time limits.
        warn: Called with one line when the endpoint turns out to refuse a parameter.

    Raises:
        ConfigError: The environment's proxy or certificate settings are unusable.
    """

    def __init__(
        self, endpoint: Endpoint, settings: HttpSettings, warn: Callable[[str], None]
    ) -> None:
        self._endpoint = endpoint
        self._settings = settings
        self.quirks = Quirks(warn)
        self.streams: bool | None = None
        """Whether the endpoint streams; None before its first answer."""
        try:
            self._lanes = Lanes(
                endpoint.auth,
                httpx.Timeout(settings.idle_s, connect=settings.connect_s, pool=None),
            )
        except (ImportError, OSError, ValueError, httpx.InvalidURL) as problem:
            raise ConfigError(
                f"the proxy or certificate settings of the environment are unusable: {problem}"
            ) from None

    @property
    def name(self) -> str:
        """The model's name."""
        return self._endpoint.model

    def __repr__(self) -> str:
        return f"OpenAIClient({self._endpoint!r})"

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`.

        Raises:
            TransientFault: An `EndpointError` after which a repetition may help.
        """
        body = wire.request_body(request, self.name)
        while True:
            sent = self.quirks.adapt(body)
            answer = await self._attempt(sent)
            if isinstance(answer, Reply):
                return answer
            said = faults.shown(self._endpoint, answer.message)
            if not self.quirks.learn(answer, sent, said):
                raise faults.error_for(self._endpoint, answer)

    async def aclose(self) -> None:
        """Close all connections."""
        await self._lanes.aclose()

    async def _attempt(self, body: dict[str, object]) -> Reply | faults.Refusal:
        """One exchange within the total time; connection failures become typed errors."""
        started = time.perf_counter()
        try:
            answer = await asyncio.wait_for(self._exchange(body), self._settings.total_s)
        except asyncio.TimeoutError:
            reason = f"no whole reply within {self._settings.total_s:g} s"
            raise faults.unreachable(self._endpoint, reason) from None
        except httpx.RequestError as problem:
            raise self._unreachable(problem) from None
        except wire.BrokenAnswerError as problem:
            raise faults.unreachable(self._endpoint, str(problem)) from None
        except wire.NoReplyError as problem:
            raise faults.no_reply(self._endpoint, str(problem)) from None
        if isinstance(answer, faults.Refusal):
            hide = self._endpoint.scrub
            message, param, code = hide(answer.message), hide(answer.param), hide(answer.code)
            return replace(answer, message=message, param=param, code=code)
        scrub = self._endpoint.scrub_known
        return answer.model_copy(
            update={
                "text": scrub(answer.text),
                "reasoning": scrub(answer.reasoning),
                "model": scrub(answer.model),
                "latency_s": round(time.perf_counter() - started, 3),
            }
        )

    def _unreachable(self, problem: httpx.RequestError) -> EndpointError:
        reason = str(problem) or type(problem).__name__
        if isinstance(problem, httpx.ReadTimeout):
            reason = f"silent for {self._settings.idle_s:g} s"
        elif isinstance(problem, httpx.ConnectTimeout):
            reason = f"no connection within {self._settings.connect_s:g} s"
        return faults.unreachable(self._endpoint, reason)

    async def _exchange(self, body: dict[str, object]) -> Reply | faults.Refusal:
        async with (
            self._lanes.lane() as http,
            http.stream("POST", self._endpoint.url, json=body) as response,
        ):
            if not response.is_success:
                start = await _at_most(response.aiter_bytes(), _LARGEST_REFUSAL)
                return faults.read_refusal(response.status_code, response.headers, start)
            try:
                return (await self._gather(response)).reply()
            except wire.ErrorObjectError as problem:
                return faults.refusal_of(200, problem.content)

    async def _gather(self, response: httpx.Response) -> wire.Gathered:
        """Take in an answer up to its end, streamed or whole."""
        framing, gathered, size = Framing(), wire.Gathered(), 0
        async with aclosing(response.aiter_bytes()) as chunks:  # type: ignore[type-var]
            async for chunk in chunks:
                size += len(chunk)
                if size > _LARGEST_ANSWER:
                    raise wire.NoReplyError(f"more than {_LARGEST_ANSWER // 2**20} MB")
                if _take(framing.feed(chunk), gathered):
                    self.streams = True
                    await _drain(chunks)
                    return gathered
        done = _take(framing.end(), gathered)
        self.streams = bool(framing.streamed)
        if framing.streamed and not gathered.finish and not done:
            raise wire.BrokenAnswerError("the stream breaks off")
        return gathered


def _take(events: list[bytes], gathered: wire.Gathered) -> bool:
    """Whether the stream's end mark was among the events."""
    for data in events:
        if data.strip() == b"[DONE]":
            return True
        gathered.add(wire.decode(data))
    return False


async def _drain(chunks: AsyncIterator[bytes]) -> None:
    async def rest() -> None:
        async for _ in chunks:
            pass

    try:
        await asyncio.wait_for(rest(), _DRAIN_S)
    except (asyncio.TimeoutError, httpx.RequestError):
        return  # the reply is whole; only the connection is lost


async def _at_most(chunks: AsyncIterator[bytes], size: int) -> bytes:
    start = bytearray()
    async for chunk in chunks:
        start += chunk
        if len(start) >= size:
            break
    return bytes(start[:size])
