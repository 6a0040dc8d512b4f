"""Progress of a sweep on stderr: a live view on a terminal, plain lines otherwise."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agentflow.app.sweeps.run import Watcher
from agentflow.cli.display.live import print_line
from agentflow.cli.display.output import SafeConsole
from agentflow.cli.display.text import escape_controls
from agentflow.metrics.tables import number
from agentflow.runs import Event, RunResult
from agentflow.runs.events import RunEvent
from agentflow.runs.record import RunRecord

SPARE = 6
"""Terminal lines that show no run."""


@contextmanager
def watch_sweep(runs: int, quiet: bool) -> Iterator[Watcher]:
    """A watcher for a sweep of this many runs, while it is running."""
    console = SafeConsole(stderr=True, highlight=False)
    if quiet or not console.is_terminal:
        yield Lines(quiet)
        return
    view = SweepView(runs, console)
    with Live(get_renderable=view.draw, console=console, refresh_per_second=4, transient=False):
        yield view


class Lines:
    """Prints a line when a run starts, ends or has a notice; only failures if quiet."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet

    def run_started(self, run: str) -> None:
        self._print(f"{run}: started")

    def event(self, run: str, event: RunEvent | Event) -> None:
        """Show nothing."""

    def remark(self, run: str, line: str) -> None:
        self._print(f"agentflow: {run}: {line}")

    def run_finished(self, run: str, result: RunResult) -> None:
        score, seconds = number(result.score), f"{result.seconds:.0f} s"
        self._print(f"{run}: done, score {score}, {result.calls} calls, {seconds}")

    def run_failed(self, run: str, reason: str) -> None:
        print_line(f"agentflow: {run}: failed: {reason}")

    def _print(self, line: str) -> None:
        if not self._quiet:
            print_line(line)


@dataclass
class Line:
    """One run as shown."""

    state: str = "running"
    record: RunRecord = field(default_factory=RunRecord)
    result: RunResult | None = None
    message: str = ""
    started: float = field(default_factory=time.monotonic)
    ended: float | None = None

    def cells(self, name: str) -> tuple[str, ...]:
        """The run as a row of the view."""
        run, seconds = self.record, (self.ended or time.monotonic()) - self.started
        stage = run.stage.location.name if run.stage and self.state == "running" else ""
        counts = (str(run.calls), str(run.evaluations), number(self.best), f"{seconds:.0f} s")
        return (name, self.state, self.message or stage, *counts)

    @property
    def best(self) -> float | None:
        """The result's score, or the best so far."""
        return self.record.best if self.result is None else self.result.score


@dataclass
class SweepView:
    """The live view; runs are in the order in which they started."""

    runs: int
    console: Console
    lines: dict[str, Line] = field(default_factory=dict)
    started: float = field(default_factory=time.monotonic)

    def run_started(self, run: str) -> None:
        self.lines[run] = Line()

    def event(self, run: str, event: RunEvent | Event) -> None:
        self.lines[run].record.add(event)

    def remark(self, run: str, line: str) -> None:
        self.console.print(Text(escape_controls(f"{run}: {line}")))

    def run_finished(self, run: str, result: RunResult) -> None:
        line = self.lines[run]
        line.state, line.ended, line.result = "done", time.monotonic(), result

    def run_failed(self, run: str, reason: str) -> None:
        line = self.lines[run]
        line.state, line.ended, line.message = "failed", time.monotonic(), reason

    def draw(self) -> RenderableType:
        """As many runs as fit: running ones first, then failed ones, then the latest done."""
        states = [line.state for line in self.lines.values()]
        seconds = time.monotonic() - self.started
        head = (
            f"{states.count('done')} done · {states.count('failed')} failed · "
            f"{states.count('running')} running · {self.runs - len(states)} waiting · "
            f"{seconds:.0f} s"
        )
        table = Table(box=None, pad_edge=False)
        for name in ("run", "state", "stage"):
            table.add_column(name, overflow="ellipsis", no_wrap=True)
        for name in ("calls", "simulated", "best", "time"):
            table.add_column(name, justify="right", no_wrap=True)
        for name in self._chosen():
            table.add_row(*(Text(escape_controls(cell)) for cell in self.lines[name].cells(name)))
        return Group(Text(head, style="bold", overflow="ellipsis", no_wrap=True), table)

    def _chosen(self) -> list[str]:
        room = max(1, self.console.height - SPARE)
        states = ("done", "failed", "running")
        latest = list(self.lines)[::-1]
        kept = sorted(latest, key=lambda name: -states.index(self.lines[name].state))[:room]
        return [name for name in self.lines if name in kept]
