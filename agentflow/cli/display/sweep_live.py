"""Owns what is seen of a sweep while it runs: one line per run, live on a terminal.

Everything goes to stderr; standard output belongs to the outcome.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agentflow.app.sweeps.run import Watcher
from agentflow.cli.display.text import escape_controls, number
from agentflow.runs import Event

SPARE = 6
"""Lines of a terminal that are left to everything but the runs."""


@contextmanager
def watch_sweep(runs: int, quiet: bool) -> Iterator[Watcher]:
    """What is told of a sweep of so many runs, for as long as it runs."""
    console = Console(stderr=True, highlight=False)
    if quiet or not console.is_terminal:
        yield Lines(quiet)
        return
    view = View(runs, console)
    with Live(get_renderable=view.draw, console=console, refresh_per_second=4, transient=False):
        yield view


class Lines:
    """One plain line when a run begins, ends or has something to say; failures alone if quiet."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet

    def begun(self, run: str) -> None:
        """See `Watcher`, as for the other methods."""
        self._tell(f"{run}: begun")

    def event(self, run: str, event: Event) -> None:
        """Nothing is shown of single events."""

    def remark(self, run: str, line: str) -> None:
        """Kept with the run, too."""
        self._tell(f"agentflow: {run}: {line}")

    def ended(self, run: str, result: Mapping[str, Any]) -> None:
        """With score and time."""
        self._tell(f"{run}: {_in_short(result)}")

    def failed(self, run: str, reason: str) -> None:
        """Shown in any case."""
        _print(f"agentflow: {run}: failed: {reason}")

    def _tell(self, line: str) -> None:
        if not self._quiet:
            _print(line)


@dataclass
class Line:
    """One run as shown."""

    state: str = "waits"
    stage: str = ""
    calls: int = 0
    evaluations: int = 0
    best: float | None = None
    said: str = ""
    started: float = field(default_factory=time.monotonic)
    ended: float | None = None

    def note(self, event: Event) -> None:
        """Take in one event."""
        if event.kind == "stage_begin":
            self.stage = event.label
        elif event.kind == "attempt":
            self.calls += 1
        elif event.kind == "evaluation":
            self.evaluations += 1
            score = event.data["score"]
            if score is not None and event.data["valid"]:
                self.best = score if self.best is None else max(self.best, score)

    def cells(self, name: str) -> tuple[str, ...]:
        """As a row of the view."""
        seconds = (self.ended or time.monotonic()) - self.started
        counts = (str(self.calls), str(self.evaluations), number(self.best), f"{seconds:.0f} s")
        return (name, self.state, self.said or self.stage, *counts)


@dataclass
class View:
    """The live view; runs in the order in which they began."""

    runs: int
    console: Console
    lines: dict[str, Line] = field(default_factory=dict)
    started: float = field(default_factory=time.monotonic)

    def begun(self, run: str) -> None:
        """See `Watcher`, as for the other methods."""
        self.lines[run] = Line("runs")

    def event(self, run: str, event: Event) -> None:
        """Counted."""
        self.lines[run].note(event)

    def remark(self, run: str, line: str) -> None:
        """Above the view."""
        self.console.print(Text(escape_controls(f"{run}: {line}")))

    def ended(self, run: str, result: Mapping[str, Any]) -> None:
        """Kept as the run's last line."""
        line = self.lines[run]
        line.state, line.ended, line.best = "done", time.monotonic(), result["score"]
        line.stage = ""

    def failed(self, run: str, reason: str) -> None:
        """Kept as the run's last line."""
        line = self.lines[run]
        line.state, line.ended, line.said = "failed", time.monotonic(), reason

    def draw(self) -> RenderableType:
        """Running and failed runs first to stay, then the latest done, as many as there is room."""
        states = [line.state for line in self.lines.values()]
        seconds = time.monotonic() - self.started
        head = (
            f"{states.count('done')} done · {states.count('failed')} failed · "
            f"{states.count('runs')} running · {self.runs - len(states)} waiting · {seconds:.0f} s"
        )
        table = Table(box=None, pad_edge=False)
        for name in ("run", "state", "stage"):
            table.add_column(name, overflow="ellipsis", no_wrap=True)
        for name in ("calls", "tried", "best", "time"):
            table.add_column(name, justify="right", no_wrap=True)
        for name in self._chosen():
            table.add_row(*(Text(escape_controls(cell)) for cell in self.lines[name].cells(name)))
        return Group(Text(head, style="bold", overflow="ellipsis", no_wrap=True), table)

    def _chosen(self) -> list[str]:
        room = max(1, self.console.height - SPARE)
        weight = {"runs": 2, "failed": 1, "done": 0}
        names = list(self.lines)
        ranked = sorted(
            range(len(names)), key=lambda i: (weight[self.lines[names[i]].state], i), reverse=True
        )
        return [names[i] for i in sorted(ranked[:room])]


def _in_short(result: Mapping[str, Any]) -> str:
    score = number(result["score"])
    return f"done, score {score}, {result['calls']} calls, {result['seconds']:.0f} s"


def _print(line: str) -> None:
    """Print to stderr; a sweep goes on when nobody is there to read."""
    with suppress(OSError, ValueError):
        print(escape_controls(line), file=sys.stderr, flush=True)
