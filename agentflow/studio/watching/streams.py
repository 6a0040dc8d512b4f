"""Event streams: what changes in the folder of runs, or in one run, as server-sent events."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

from agentflow.errors import AgentflowError
from agentflow.runs import state_of
from agentflow.studio.watching.listing import Follower, Listing

EVERY_S = 0.7
"""Seconds between looks at the files."""
QUIET = 20
"""Looks without news after which a comment keeps the connection alive."""
News = Mapping[str, Any] | None
"""What one look has found; None without news."""


async def as_stream(news: AsyncIterator[News]) -> AsyncIterator[str]:
    """News as text of server-sent events; what goes wrong is told in the last one."""
    quiet = 0
    try:
        async for item in news:
            quiet = 0 if item is not None else quiet + 1
            if item is not None:
                yield _message(item)
            elif quiet % QUIET == 0:
                yield ": still here\n\n"
    except AgentflowError as error:
        yield _message({"problem": str(error)})


async def follow_list(listing: Listing) -> AsyncIterator[News]:
    """All rows, then those that have changed, and the names of those that are gone."""
    told: dict[str, dict[str, Any]] | None = None
    while True:
        rows = {row["run"]: row for row in await asyncio.to_thread(listing.rows)}
        before = told or {}
        changed = [row for name, row in rows.items() if before.get(name) is not row]
        gone = [name for name in before if name not in rows]
        is_news = changed or gone or told is None
        yield {"rows": changed, "gone": gone} if is_news else None
        told = rows
        await asyncio.sleep(EVERY_S)


async def follow_run(path: Path) -> AsyncIterator[News]:
    """The scores of one run so far, then each new one, and its state; ends when the run does."""
    follower, told = Follower(path), ("", -1)
    while True:
        state = await asyncio.to_thread(state_of, path)  # first, so that no late event is missed
        points = await asyncio.to_thread(follower.new_points)
        record = follower.record
        now = (state, record.calls)
        news = {"state": state, "points": points, "best": record.best, "calls": record.calls}
        yield news if points or now != told else None
        if state == "done":
            return
        told = now
        await asyncio.sleep(EVERY_S)


def _message(data: object) -> str:
    return f"data: {json.dumps(data, allow_nan=False)}\n\n"
