"""An MCP server whose every connection is a session at a bench."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol

from mcp import types
from mcp.server.context import CallNext, HandlerResult, ServerRequestContext
from mcp.server.lowlevel import NotificationOptions, Server
from mcp.server.models import InitializationOptions
from mcp.shared.exceptions import MCPError
from mcp.types.version import HANDSHAKE_PROTOCOL_VERSIONS, MODERN_PROTOCOL_VERSIONS

from agentflow.errors import AgentflowError
from agentflow.integrations.mcp import content
from agentflow.progress import TALLY, Tally
from agentflow.tools import READING, Bench, ToolResult
from agentflow.version import __version__

BEAT: Final = 1.0
"""Seconds between progress notifications."""
LONGEST_NAME: Final = 60
"""Characters of a client's name that are kept."""
_SESSION: Final = "agentflow"
_TALLY: Final = "tally"
Context = ServerRequestContext[Any, Any]


class ClientSession(Protocol):
    """The work of one client, from its first call until it leaves."""

    async def bench(self) -> Bench | None:
        """The bench of the current stage, once it is ready; None after the last stage.

        Raises:
            AgentflowError: The work cannot begin or go on.
        """

    @property
    def last(self) -> Bench | None:
        """The bench of the last stage, once that has ended, if clients may still read there."""

    @property
    def farewell(self) -> str:
        """The message to a client once there are no more benches."""

    @property
    def outcome(self) -> Mapping[str, Any]:
        """The same as data."""

    @property
    def events(self) -> str:
        """What has been recorded so far, one JSON object per line."""

    def leave(self) -> None:
        """The client has gone; nothing further is expected of it."""


Sessions = Callable[[str], ClientSession]
"""Opens the session of a client with this name and version."""


@dataclass(frozen=True)
class OneBench:
    """A session at a bench that belongs to somebody else, who also records what happens."""

    only: Bench
    last: None = None
    farewell: str = "This stage has ended; there is nothing more to do here."
    events: str = ""
    outcome: Mapping[str, Any] = field(default_factory=dict)

    async def bench(self) -> Bench | None:
        """The bench, until its stage ends."""
        return None if self.only.ended else self.only

    def leave(self) -> None:
        """The stage goes on: other clients may come."""


def build_server(sessions: Sessions) -> Server[Any]:
    """A server that opens a session for each connection and serves its bench."""
    answers = _Answers(sessions)
    server = _Server(
        "agentflow",
        version=__version__,
        instructions=content.INSTRUCTIONS,
        on_list_tools=answers.list_tools,
        on_call_tool=answers.call_tool,
        on_list_resources=answers.list_resources,
        on_list_resource_templates=answers.list_templates,
        on_read_resource=answers.read_resource,
        on_list_prompts=answers.list_prompts,
        on_get_prompt=answers.get_prompt,
    )
    server.middleware.append(_require_handshake)
    return server


class _Server(Server[Any]):
    """Tells clients that it notifies them when another stage has other tools."""

    def create_initialization_options(
        self,
        notification_options: NotificationOptions | None = None,
        experimental_capabilities: dict[str, dict[str, Any]] | None = None,
        extensions: dict[str, dict[str, Any]] | None = None,
    ) -> InitializationOptions:
        """Those of the SDK, with changes of tools."""
        options = notification_options or NotificationOptions(tools_changed=True)
        return super().create_initialization_options(options, experimental_capabilities, extensions)


async def _require_handshake(ctx: Context, call_next: CallNext) -> HandlerResult:
    """Refuse the revisions without sessions, so that clients fall back to one that has them."""
    if ctx.protocol_version not in MODERN_PROTOCOL_VERSIONS:
        return await call_next(ctx)
    served = list(HANDSHAKE_PROTOCOL_VERSIONS)
    raise MCPError(
        types.UNSUPPORTED_PROTOCOL_VERSION,
        f"a bench needs a session; connect with `initialize` and one of {', '.join(served)}",
        {"supported": served, "requested": ctx.protocol_version},
    )


class _Answers:
    """Handlers of requests."""

    def __init__(self, sessions: Sessions) -> None:
        self._sessions = sessions

    def _session(self, ctx: Context) -> ClientSession:
        """The session of the connection that a request came on, whose simulations are counted
        from here on."""
        connection = ctx.session._connection  # the SDK offers handlers no other way to it
        TALLY.set(connection.state.setdefault(_TALLY, Tally()))
        if _SESSION not in connection.state:
            session = self._sessions(_client_name(ctx))
            connection.state[_SESSION] = session
            connection.exit_stack.callback(session.leave)
        found: ClientSession = connection.state[_SESSION]
        return found

    async def _find_bench(self, ctx: Context) -> Bench | None:
        """The bench of the current or last stage, if there is one, for requests besides calls."""
        session = self._session(ctx)
        try:
            return await session.bench() or session.last
        except AgentflowError as error:
            raise MCPError(types.INTERNAL_ERROR, str(error)) from None

    async def _bench(self, ctx: Context, *, ended: bool = False) -> Bench:
        """The bench of the current or, if `ended`, last stage; else an error that says how the
        last one ended."""
        bench = await self._find_bench(ctx)
        if bench is None or (bench.ended and not ended):
            raise MCPError(types.INVALID_REQUEST, self._session(ctx).farewell)
        return bench

    async def list_tools(
        self, ctx: Context, _params: types.PaginatedRequestParams | None
    ) -> types.ListToolsResult:
        bench = await self._find_bench(ctx)
        specs = (bench.reading if bench.ended else bench.tools) if bench else ()
        return types.ListToolsResult(tools=[content.tool(spec) for spec in specs])

    async def call_tool(
        self, ctx: Context, params: types.CallToolRequestParams
    ) -> types.CallToolResult:
        async def tell_of_tools() -> None:
            changed = types.ToolListChangedNotification()
            await ctx.session.send_notification(changed, ctx.request_id)

        session = self._session(ctx)
        async with _progress(ctx):
            try:
                result = await _call(session, params.name, params.arguments, tell_of_tools)
            except AgentflowError as error:
                result = ToolResult(str(error), {"refused": str(error)}, refused=True)
        return content.tool_result(result)

    async def list_resources(
        self, ctx: Context, _params: types.PaginatedRequestParams | None
    ) -> types.ListResourcesResult:
        bench = await self._find_bench(ctx)
        events = self._session(ctx).events
        return types.ListResourcesResult(resources=content.resources(bench, events))

    async def list_templates(
        self, _ctx: Context, _params: types.PaginatedRequestParams | None
    ) -> types.ListResourceTemplatesResult:
        return types.ListResourceTemplatesResult(resource_templates=[content.TEMPLATE])

    async def read_resource(
        self, ctx: Context, params: types.ReadResourceRequestParams
    ) -> types.ReadResourceResult:
        uri = str(params.uri)
        if uri == content.EVENTS:
            return content.text_of(uri, self._session(ctx).events)
        bench = await self._bench(ctx, ended=True)
        return content.text_of(uri, content.read(bench, uri))

    async def list_prompts(
        self, _ctx: Context, _params: types.PaginatedRequestParams | None
    ) -> types.ListPromptsResult:
        return types.ListPromptsResult(prompts=list(content.PROMPTS))

    async def get_prompt(
        self, ctx: Context, params: types.GetPromptRequestParams
    ) -> types.GetPromptResult:
        return await content.prompt(await self._bench(ctx), params.name, params.arguments or {})


async def _call(
    session: ClientSession, name: str, arguments: object, on_change: Callable[[], Awaitable[None]]
) -> ToolResult:
    """Call a tool at the session's bench; a call that ends the stage also says what follows.

    Args:
        session: Where the call came.
        name: Name of the tool.
        arguments: As the client sent them.
        on_change: Is called if other tools are on offer from now on.
    """
    bench = await session.bench()
    if bench is None:
        if name in READING and (last := session.last):
            return _part(session, await last.review(name, arguments))
        data = {"refused": session.farewell, **session.outcome}
        return ToolResult(session.farewell, data, refused=True)
    result = await bench.call(name, arguments)
    if not bench.ended:
        return result
    following = await session.bench()
    if following is None:
        if session.last:
            await on_change()
        return _part(session, result)
    if following.tools != bench.tools:
        await on_change()
    tools = ", ".join(tool.name for tool in following.tools)
    return replace(result, text=f"{result.text}\n\nThe next stage begins. Its tools: {tools}.")


def _part(session: ClientSession, result: ToolResult) -> ToolResult:
    """An answer, and how the run ended."""
    data = {**result.data, **session.outcome}
    return replace(result, text=f"{result.text}\n\n{session.farewell}", data=data)


def _client_name(ctx: Context) -> str:
    """Name and version of the client, which it chose itself: printable, and not long."""
    params = ctx.session.client_params
    info = params.client_info if params else None
    name = f"{info.name} {info.version}" if info else "unknown"
    return " ".join("".join(c if c.isprintable() else " " for c in name).split())[:LONGEST_NAME]


@asynccontextmanager
async def _progress(ctx: Context) -> AsyncIterator[None]:
    """Tell the client every second that its call is still being worked on, and what is done."""
    tally = TALLY.get()

    async def beat() -> None:
        seconds = 0.0
        while True:
            done = f"{tally}, " * bool(str(tally))
            await ctx.session.report_progress(seconds, message=f"{done}working for {seconds:g} s")
            await asyncio.sleep(BEAT)
            seconds += BEAT

    beating = asyncio.create_task(beat())
    try:
        yield
    finally:
        beating.cancel()
        with suppress(asyncio.CancelledError):
            await beating
