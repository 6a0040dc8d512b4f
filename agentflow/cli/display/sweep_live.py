"""Progress of a running sweep: one line per run, live on a terminal.

Everything goes to stderr; stdout is for the result.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agentflow.app.sweeps.run import Watcher
from agentflow.cli.display.live import print_line
from agentflow.cli.display.text import escape_controls, number
from agentflow.runs import Event
from agentflow.runs.events import typed
from agentflow.runs.record import RunRecord

SPARE = 6
"""Terminal lines kept free of runs."""


@contextmanager
def watch_sweep(runs: int, quiet: bool) -> Iterator[Watcher]:
    """A watcher for a sweep of this many runs, while it goes on."""
    console = Console(stderr=True, highlight=False)
    if quiet or not console.is_terminal:
        yield Lines(quiet)
        return
    view = View(runs, console)
    with Live(get_renderable=view.draw, console=console, refresh_per_second=4, transient=False):
        yield view


class Lines:
    """Prints a line when a run begins, ends or has a remark; failures only if quiet."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet

    def run_started(self, run: str) -> None:
        """See `Watcher`, as for the other methods."""
        self._tell(f"{run}: begun")

    def event(self, run: str, event: Event) -> None:
        """Single events are not shown."""

    def remark(self, run: str, line: str) -> None:
        """Print the remark."""
        self._tell(f"agentflow: {run}: {line}")

    def run_finished(self, run: str, result: Mapping[str, Any]) -> None:
        """Print score and time."""
        self._tell(f"{run}: {_in_short(result)}")

    def run_failed(self, run: str, reason: str) -> None:
        """Print the reason, even if quiet."""
        print_line(f"agentflow: {run}: failed: {reason}")

    def _tell(self, line: str) -> None:
        if not self._quiet:
            print_line(line)


@dataclass
class Line:
    """One run as shown."""

    state: str = "waits"
    record: RunRecord = field(default_factory=RunRecord)
    result: Mapping[str, Any] | None = None
    message: str = ""
    started: float = field(default_factory=time.monotonic)
    ended: float | None = None

    def cells(self, name: str) -> tuple[str, ...]:
        """The run as a row of the view."""
        run, seconds = self.record, (self.ended or time.monotonic()) - self.started
        stage = run.stage.place.name if run.stage and self.state == "runs" else ""
        counts = (str(run.calls), str(run.evaluations), number(self.best), f"{seconds:.0f} s")
        return (name, self.state, self.message or stage, *counts)

    @property
    def best(self) -> float | None:
        """The result's score, or the best so far."""
        return self.record.best if self.result is None else self.result["score"]


@dataclass
class View:
    """The live view; runs are in the order in which they began."""

    runs: int
    console: Console
    lines: dict[str, Line] = field(default_factory=dict)
    started: float = field(default_factory=time.monotonic)

    def run_started(self, run: str) -> None:
        """See `Watcher`, as for the other methods."""
        self.lines[run] = Line("runs")

    def event(self, run: str, event: Event) -> None:
        """Count the event."""
        self.lines[run].record.add(typed(event))

    def remark(self, run: str, line: str) -> None:
        """Print the remark above the view."""
        self.console.print(Text(escape_controls(f"{run}: {line}")))

    def run_finished(self, run: str, result: Mapping[str, Any]) -> None:
        """Kept as the run's last line."""
        line = self.lines[run]
        line.state, line.ended, line.result = "done", time.monotonic(), result

    def run_failed(self, run: str, reason: str) -> None:
        """Kept as the run's last line."""
        line = self.lines[run]
        line.state, line.ended, line.message = "failed", time.monotonic(), reason

    def draw(self) -> RenderableType:
        """As many runs as fit: running ones, then failed ones, then the latest done."""
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
