"""The list of runs, and how the best score of each rose over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agentflow.app.inspect.overview import run_list
from agentflow.app.sweeps.folder import is_sweep
from agentflow.errors import RunError
from agentflow.runs import find_runs, state_of
from agentflow.runs.document import FILE_NAME
from agentflow.runs.events import EvaluationEvent, typed_event
from agentflow.runs.reading import CALLS, EVENTS, RESULT, Event, read_new_events
from agentflow.runs.record import RunRecord
from agentflow.studio.folder import RunFolder

Row = dict[str, Any]
Signature = tuple[object, ...]


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
        events, self._offset = read_new_events(self.path, self._offset)
        return list(self._points(events))

    def _points(self, events: list[Event]) -> Iterator[dict[str, float]]:
        for event in events:
            try:
                typed = typed_event(event)
            except ValueError as error:
                raise RunError(f"{self.path / EVENTS} is damaged: {error}") from None
            self.record.add(typed)
            if isinstance(typed, EvaluationEvent) and typed.score is not None:
                yield {
                    "at": event.at,
                    "expansions": self.record.steps,
                    "calls": self.record.calls,
                    "tokens": self.record.tokens,
                    "score": typed.score,
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
        """Every run as `run_list` tells it, by name, and its sweep, start, and best over time."""
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
