"""Owns what is told to the user during a run and kept with it, though it changes no result."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from agentflow.runs import Event, RunDirectory, read_events
from agentflow.runs.events import RemarkEvent
from agentflow.runs.reading import EVENTS

Say = Callable[[str], None]
"""Takes one line of text for the user: waits, refused parameters, dropped half lines."""
REMARK = RemarkEvent.kind
"""Kind of the events that `Remarks` keeps; replays pass over them."""
WHY = "a rollout had been cut off, a file edited, or agentflow has changed"


class Remarks:
    """What endpoint and files did out of order: waits, refused parameters, half lines, the end.

    Kept among the run's events, numbered on when the run is resumed.
    """

    def __init__(self, run: RunDirectory, say: Say) -> None:
        self._run, self._say = run, say
        self._count = sum(event.kind == REMARK for event in read_events(run.path))

    def tell(self, line: str) -> None:
        """Show a line to the user, and keep it."""
        self._say(line)
        self.keep(line)

    def keep(self, line: str) -> None:
        """Keep a line that the user sees by another way."""
        self._count += 1
        self._run.event(REMARK, str(self._count), text=line)

    def tell_differences(self) -> None:
        """Say what of the record of an earlier process this one has not repeated, if anything."""
        for line in _differences(self._run):
            self.tell(line)


def _differences(run: RunDirectory) -> Iterator[str]:
    if run.dropped:
        yield f"{run.path / EVENTS}: dropped a half-written last line ({run.dropped} bytes)"
    if run.replaced:
        yield (
            f"{len(run.replaced)} of the recorded events came out otherwise this time, first "
            f"{_name(run.replaced[0])}: {WHY}; both are kept, the later one holds"
        )
    left = [event for event in run.unreproduced() if event.kind != REMARK]
    if left:
        yield (
            f"{len(left)} of the recorded events did not happen this time, first {_name(left[0])}: "
            f"{WHY}; they are kept"
        )


def _name(event: Event) -> str:
    return f"{event.kind} {event.label}"
