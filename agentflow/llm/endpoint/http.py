"""A client for OpenAI-compatible endpoints over httpx: one attempt per call."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import aclosing, asynccontextmanager, suppress
from dataclasses import replace
from urllib.request import getproxies

import httpx

from agentflow.errors import ConfigError, EndpointError
from agentflow.llm.endpoint import faults, wire
from agentflow.llm.endpoint.body import Endpoint, request_body
from agentflow.llm.endpoint.reading import ACCEPTED, UndecodableError, decoded_pieces, read_answer
from agentflow.llm.endpoint.unsupported import UnsupportedParameters, refuses_images, refuses_tools
from agentflow.llm.messages import Reply, Request, ToolCall
from agentflow.llm.settings import HttpSettings

_MAX_IDLE = 64
"""Idle clients kept for later calls; any more are closed after use."""
_LOOPBACK = ("all://127.0.0.1", "all://localhost", "all://[::1]")


class ConnectionPool:
    """Lends httpx clients; the most recently used, whose connections are likely open, come first.

    Each client has one connection, for one call at a time: httpx's own pool scans all its
    connections several times per request; with 64 concurrent calls that costs more than all other
    work of a call.

    httpx reads proxies and certificates from the environment; loopback addresses are never proxied.
    Without a proxy in the environment, clients skip looking for one, which saves two thirds of the
    cost of creating them.

    Args:
        auth: Authentication of every request.
        timeout: Time-outs for connecting and reading.

    Raises:
        ImportError: The environment sets a SOCKS proxy and the package for it is not installed.
        OSError: Certificates set in the environment cannot be read.
        ValueError: The environment sets a proxy with an unknown scheme.
        httpx.InvalidURL: The environment sets a proxy that is not a URL.
    """

    def __init__(self, auth: httpx.Auth | None, timeout: httpx.Timeout) -> None:
        self._auth = auth
        self._timeout = timeout
        self._certificates = httpx.create_ssl_context()
        self._proxied = bool(getproxies())
        self._idle = [self._new()]

    @asynccontextmanager
    async def acquire(self) -> AsyncIterator[httpx.AsyncClient]:
        """A client for the exclusive use of one call."""
        http = self._idle.pop() if self._idle else self._new()
        try:
            yield http
        finally:
            if len(self._idle) < _MAX_IDLE:
                self._idle.append(http)
            else:
                await http.aclose()

    async def aclose(self) -> None:
        """Close all connections; no call may be in progress."""
        while self._idle:
            await self._idle.pop().aclose()

    def _new(self) -> httpx.AsyncClient:
        return httpx.AsyncClient(
            auth=self._auth,
            timeout=self._timeout,
            verify=self._certificates,
            limits=httpx.Limits(max_connections=None, max_keepalive_connections=1),
            trust_env=self._proxied,
            mounts=dict.fromkeys(_LOOPBACK) if self._proxied else None,
        )


_MAX_ANSWER_BYTES = 64 * 2**20
_MAX_ERROR_BYTES = 2**16
_HEADERS = {"Accept-Encoding": ACCEPTED}
_NO_TOOLS = (
    "does not support tools",
    "switch on tool calling at the server, or use another model, or a workflow without tools",
)
_NO_PICTURES = "takes no pictures", "use a model that sees, or leave out the sketch and vision"
_DRAIN_S = 1.0
"""Maximum wait for a stream to end after `[DONE]`; its connection can then be reused."""
_BROKEN = (httpx.RequestError, UndecodableError, wire.NotACompletionError)
"""What can be wrong with the bytes of an answer."""


class OpenAIClient:
    """Sends requests to one model of an OpenAI-compatible endpoint.

    Args:
        endpoint: Where requests go.
        settings: Time-outs.
        warn: Called with one line when the endpoint rejects a parameter.

    Raises:
        ConfigError: The environment's proxy or certificate settings are invalid.
    """

    def __init__(
        self, endpoint: Endpoint, settings: HttpSettings, warn: Callable[[str], None]
    ) -> None:
        self.name = endpoint.model
        self._endpoint = endpoint
        self._settings = settings
        self.unsupported = UnsupportedParameters(warn)
        self.streams: bool | None = None
        """Whether the endpoint streams; None before the first answer."""
        try:
            self._connections = ConnectionPool(
                endpoint.auth, httpx.Timeout(settings.idle_s, connect=settings.connect_s, pool=None)
            )
        except (ImportError, OSError, ValueError, httpx.InvalidURL) as problem:
            raise ConfigError(
                f"invalid proxy or certificate settings in the environment: {problem}"
            ) from None

    async def complete(self, request: Request) -> Reply:
        """Answer one request; see `Client`.

        Raises:
            TransientFault: An `EndpointError` after which a retry may help.
        """
        body = request_body(request, self.name)
        while True:
            sent = self.unsupported.adapt(body)
            answer = await self._attempt(sent)
            if isinstance(answer, Reply):
                return answer
            message = faults.printable_excerpt(self._endpoint, answer.message)
            if self.unsupported.learn(answer, sent, message):
                continue
            if request.tools and refuses_tools(answer):
                raise faults.unable(self._endpoint, answer, *_NO_TOOLS)
            if any(message.images for message in request.messages) and refuses_images(answer):
                raise faults.unable(self._endpoint, answer, *_NO_PICTURES)
            raise faults.error_for(self._endpoint, answer)

    async def aclose(self) -> None:
        """Close all connections."""
        await self._connections.aclose()

    async def _attempt(self, body: dict[str, object]) -> Reply | faults.ErrorResponse:
        """Send one request within the total time-out; connection failures become typed errors."""
        started = time.perf_counter()
        try:
            answer = await asyncio.wait_for(self._exchange(body), self._settings.total_s)
        except asyncio.TimeoutError:
            reason = f"no complete reply within {self._settings.total_s:g} s"
            raise faults.unreachable(self._endpoint, reason) from None
        except httpx.RequestError as problem:
            raise self._unreachable(problem) from None
        except (wire.TruncatedAnswerError, UndecodableError) as problem:
            raise faults.incomplete(self._endpoint, str(problem)) from None
        except wire.NotACompletionError as problem:
            raise faults.not_a_completion(self._endpoint, str(problem)) from None
        if isinstance(answer, faults.ErrorResponse):
            scrub = self._endpoint.scrub
            message, param, code = scrub(answer.message), scrub(answer.param), scrub(answer.code)
            return replace(answer, message=message, param=param, code=code)
        scrub = self._endpoint.scrub_known
        return answer.model_copy(
            update={
                "text": scrub(answer.text),
                "reasoning": scrub(answer.reasoning),
                "model": scrub(answer.model),
                "tool_calls": tuple(_scrub_call(call, scrub) for call in answer.tool_calls),
                "latency_s": round(time.perf_counter() - started, 3),
            }
        )

    def _unreachable(self, problem: httpx.RequestError) -> EndpointError:
        reason = str(problem) or type(problem).__name__
        if isinstance(problem, httpx.ReadTimeout):
            return faults.silent(self._endpoint, self._settings.idle_s)
        if isinstance(problem, httpx.ConnectTimeout):
            reason = f"no connection within {self._settings.connect_s:g} s"
        elif isinstance(problem, httpx.ConnectError) and "All connection" in reason:
            reason = "connection refused: is the server running?"
        elif isinstance(problem, httpx.ReadError | httpx.WriteError):
            reason = "connection reset"
        return faults.unreachable(self._endpoint, reason)

    async def _exchange(self, body: dict[str, object]) -> Reply | faults.ErrorResponse:
        async with (
            self._connections.acquire() as http,
            http.stream("POST", self._endpoint.url, json=body, headers=_HEADERS) as response,
        ):
            if not response.is_success:
                start = await _read_at_most(decoded_pieces(response), _MAX_ERROR_BYTES)
                return faults.read_error_response(response.status_code, response.headers, start)
            try:
                return (await self._read_answer(response)).reply()
            except wire.ErrorObjectError as problem:
                return faults.parse_error_object(200, problem.content)

    async def _read_answer(self, response: httpx.Response) -> wire.ReplyBuilder:
        """Read an answer to its end, streamed or not."""
        builder = wire.ReplyBuilder()
        streamed, parts = await read_answer(_limited(decoded_pieces(response)))
        async with aclosing(parts):
            async for text in parts:
                if text.strip() == "[DONE]":
                    self.streams = streamed
                    with suppress(asyncio.TimeoutError, *_BROKEN):  # the reply is whole
                        await asyncio.wait_for(_read_to_end(parts), _DRAIN_S)
                    return builder
                builder.add(wire.decode(text))
        self.streams = streamed
        if streamed and not builder.finish:
            raise wire.TruncatedAnswerError("the stream ended early")
        return builder


def _scrub_call(call: ToolCall, scrub: Callable[[str], str]) -> ToolCall:
    return call.model_copy(update={"name": scrub(call.name), "arguments": scrub(call.arguments)})


async def _limited(pieces: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """The pieces of an answer, unless it is too large."""
    size = 0
    async for piece in pieces:
        size += len(piece)
        if size > _MAX_ANSWER_BYTES:
            raise wire.NotACompletionError(f"more than {_MAX_ANSWER_BYTES // 2**20} MB")
        yield piece


async def _read_to_end(parts: AsyncIterator[str]) -> None:
    async for _ in parts:
        pass


async def _read_at_most(chunks: AsyncIterator[bytes], size: int) -> bytes:
    start = bytearray()
    async for chunk in chunks:
        start += chunk
        if len(start) >= size:
            break
    return bytes(start[:size])
