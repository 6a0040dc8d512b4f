"""Owns what is told to the user during a run and kept with it, though it changes no result."""

from __future__ import annotations

from collections.abc import Callable

from agentflow.runs import RunDirectory, read_events

Say = Callable[[str], None]
"""Takes one line of text for the user: waits, refused parameters, dropped half lines."""
REMARK = "remark"
"""Kind of the events that `Remarks` keeps; replays pass over them."""


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
