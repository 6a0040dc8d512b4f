"""The list of runs, how the best score of each rose over time, and what changes, as events."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agentflow.app.inspect.overview import run_list
from agentflow.app.sweeps.folder import is_sweep
from agentflow.errors import AgentflowError, RunError
from agentflow.runs import find_runs, state_of
from agentflow.runs.events import EvaluationEvent, RunEvent, read_new_typed_events
from agentflow.runs.reading import CALLS, EVENTS, FILE_NAME, RESULT, Event
from agentflow.runs.record import RunRecord
from agentflow.studio.folder import RunFolder

Row = dict[str, Any]
Signature = tuple[object, ...]
EVERY_S = 0.7
"""Seconds between looks at the files."""
QUIET = 20
"""Looks without news after which a comment keeps the connection alive."""
News = Mapping[str, Any] | None
"""What one look has found; None without news."""


@dataclass
class Follower:
    """Follows the events of one run as they are written."""

    path: Path
    record: RunRecord = field(default_factory=RunRecord)
    _offset: int = 0

    def new_points(self) -> list[dict[str, float]]:
        """The scores that have been added: seconds into the run, calls, tokens, steps, score.

        Raises:
            RunError: The events are damaged.
        """
        events, self._offset = read_new_typed_events(self.path, self._offset)
        return list(self._points(events))

    def _points(self, events: Iterable[RunEvent | Event]) -> Iterator[dict[str, float]]:
        for event in events:
            self.record.add(event)
            if isinstance(event, EvaluationEvent) and event.score is not None:
                yield {
                    "at": event.at,
                    "expansions": self.record.steps,
                    "calls": self.record.calls,
                    "tokens": self.record.tokens,
                    "score": event.score,
                }


@dataclass
class _Known:
    """What is known of a run: its row, and the files that it was read from."""

    signature: Signature
    row: Row
    follower: Follower
    curve: list[tuple[float, float]]


class Listing:
    """The runs of a folder; those whose files have not changed are not read again."""

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder
        self._known: dict[Path, _Known] = {}

    def rows(self) -> list[Row]:
        """Every run as `run_list` lists it, by name, and its sweep, start, and best over time."""
        if not self._folder.root.is_dir():
            return []
        runs = list(find_runs(self._folder.root))
        self._known = {path: self._read(path) for path in runs}
        return [known.row for known in self._known.values()]

    def _read(self, path: Path) -> _Known:
        known, signature = self._known.get(path), _signature(path)
        if known and known.signature == signature:
            return known
        known = known or _Known((), {}, Follower(path), [])
        known.signature = signature
        try:
            self._extend(known)
        except RunError:
            known.curve.clear()
        row = next(run_list(path))
        verified = row["verified"]
        known.row = {
            **row,
            "run": self._folder.name_of(path),
            "verified": verified["score"] if verified else None,
            "fragile": bool(verified and verified["fragile"]),
            "sweep": self._sweep_of(path),
            "begun": (path / FILE_NAME).stat().st_mtime,
            "curve": known.curve,
        }
        return known

    def _extend(self, known: _Known) -> None:
        """Add to the curve every score that is better than those before."""
        for point in known.follower.new_points():
            if not known.curve or point["score"] > known.curve[-1][1]:
                known.curve = [*known.curve, (point["at"], point["score"])]

    def _sweep_of(self, path: Path) -> str | None:
        """The name of the sweep that a run belongs to."""
        for above in path.parents:
            if above == self._folder.root.parent:
                break
            if is_sweep(above):
                return above.name if above == self._folder.root else self._folder.name_of(above)
        return None


def _signature(path: Path) -> Signature:
    """Differs whenever the files of a run, or its state, do."""
    found: list[object] = []
    for name in (FILE_NAME, EVENTS, CALLS, RESULT):
        try:
            status = (path / name).stat()
            found += (status.st_size, status.st_mtime_ns)
        except OSError:
            found.append(None)
    try:
        found.append(state_of(path))
    except RunError:
        found.append("damaged")
    return tuple(found)


async def as_stream(news: AsyncIterator[News]) -> AsyncIterator[str]:
    """News as text of server-sent events; an error is reported in the last one."""
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
