"""What a connected client works in: the benches of its stages, one after the other."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Protocol

from agentflow.tools import Bench, ToolResult


class Session(Protocol):
    """The work of one client, from its first call until it leaves."""

    async def bench(self) -> Bench | None:
        """The bench of the current stage, once it is ready; None after the last stage.

        Raises:
            AgentflowError: The work cannot begin or go on.
        """

    @property
    def farewell(self) -> str:
        """What a client is told once there is no further bench."""

    @property
    def events(self) -> str:
        """What has been recorded so far, one JSON object per line."""

    def leave(self) -> None:
        """The client has gone; nothing further is expected of it."""


Sessions = Callable[[str], Session]
"""Opens the session of a client with this name and version."""


@dataclass(frozen=True)
class OneBench:
    """A session at a bench that belongs to somebody else, who also records what happens."""

    only: Bench
    farewell: str = "This stage has ended; there is nothing more to do here."
    events: str = ""

    async def bench(self) -> Bench | None:
        """The bench, until its stage ends."""
        return None if self.only.ended else self.only

    def leave(self) -> None:
        """The stage goes on: other clients may come."""


async def call(
    session: Session, name: str, arguments: object, on_change: Callable[[], Awaitable[None]]
) -> ToolResult:
    """Call a tool at the session's bench; a call that ends the stage also tells what follows.

    Args:
        session: Where the call came.
        name: Name of the tool.
        arguments: As the client sent them.
        on_change: Is called if the next stage has other tools.
    """
    bench = await session.bench()
    if bench is None:
        return ToolResult(session.farewell, {"refused": session.farewell}, refused=True)
    result = await bench.call(name, arguments)
    if not bench.ended:
        return result
    following = await session.bench()
    if following is None:
        return replace(result, text=f"{result.text}\n\n{session.farewell}")
    if following.tools != bench.tools:
        await on_change()
    tools = ", ".join(tool.name for tool in following.tools)
    return replace(result, text=f"{result.text}\n\nThe next stage begins. Its tools: {tools}.")
