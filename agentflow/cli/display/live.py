"""Progress of a run on stderr: a live view on a terminal, plain lines otherwise."""

import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agentflow.cli.display.output import SafeConsole
from agentflow.cli.display.text import escape_controls
from agentflow.metrics.failure_kinds import CUT_OFF, EMPTY, FILTERED
from agentflow.metrics.niches import Elites, best_by_class
from agentflow.metrics.tables import counted, number
from agentflow.progress import TALLY, Tally
from agentflow.runs import Event, Listener, Notify
from agentflow.runs import events as kinds
from agentflow.runs.record import RunRecord

BARS, WIDEST = "▁▂▃▄▅▆▇█", 40
MOMENT_S, BETWEEN_S = 1.0, 10.0
"""Seconds of simulation before the first line, and then between lines, at first."""


@contextmanager
def watch(quiet: bool, calls: int = 0) -> Iterator[tuple[Listener | None, Notify]]:
    """A listener for a run's events and a callback for its notices; neither prints if quiet.

    Args:
        quiet: Print nothing.
        calls: About how many calls the run makes; 0 if unknown.
    """
    console = SafeConsole(stderr=True, highlight=False)
    if quiet:
        yield None, lambda _line: None
    elif console.is_terminal:
        view = RunView(expected=calls)
        with Live(get_renderable=view.draw, console=console, refresh_per_second=8) as live:
            yield view.note, lambda line: console.print(Text(escape_controls(line)))
            live.transient = True  # the result follows; a failed run leaves its view
    else:
        yield PlainProgress(calls).note, print_remark


def print_line(line: str) -> None:
    """Print to stderr; a closed stderr is ignored."""
    with suppress(OSError, ValueError):
        print(escape_controls(line), file=sys.stderr, flush=True)


def print_remark(line: str, quiet: bool = False) -> None:
    """Print a remark of a command to stderr, unless the user wants none."""
    if not quiet:
        print_line(f"agentflow: {line}")


@contextmanager
def watch_simulations() -> Iterator[None]:
    """Tell on stderr how many simulations are done, while they take longer than a moment."""
    tally, over = Tally(), threading.Event()
    again = TALLY.set(tally)

    def tell() -> None:
        pause, told = MOMENT_S, ""
        while not over.wait(pause):
            if (done := str(tally)) not in ("", told):
                pause, told = min(max(BETWEEN_S, 2 * pause), EVERY_S), done
                print_remark(done)

    threading.Thread(target=tell, daemon=True).start()
    try:
        yield
    finally:
        over.set()
        TALLY.reset(again)


@dataclass
class _Progress:
    expected: int = 0
    """About how many calls the run makes; 0 if unknown."""
    record: RunRecord = field(default_factory=RunRecord)


@dataclass
class RunView(_Progress):
    """The live view of a run.

    `ending` is what is done after the workflow, `under_way` counts calls without an answer yet,
    `cost` is None if unknown, and `curve` has the best score after each evaluation.
    """

    ending: str = ""
    under_way: int = 0
    cost: float | None = 0.0
    curve: list[float] = field(default_factory=list)
    failures: deque[str] = field(default_factory=lambda: deque(maxlen=3))
    started: float = field(default_factory=time.monotonic)

    def note(self, item: kinds.RunEvent | Event) -> None:
        """Take in one event."""
        if isinstance(item, kinds.RunStartEvent):  # the next of several runs
            self.record, self.curve = RunRecord(), []
        self.record.add(item)
        if isinstance(item, kinds.CallsEvent):
            self.under_way, self.cost = item.under_way, item.cost
        elif isinstance(item, kinds.ResultEvent) and item.machine is not None:
            self.ending = "verifying the best machine"
        elif isinstance(item, kinds.DrawingEvent):
            done, of = item.frames
            self.ending = f"drawing pictures, frame {done} of {of}" if of else "drawing pictures"
        elif isinstance(item, kinds.AttemptEvent) and not item.valid:
            self.failures.append(f"{item.label}: {_refusal(item)}")
        elif isinstance(item, kinds.ToolEvent) and item.refused:
            self.failures.append(f"{item.label}: {item.tool}: {item.answer.partition(chr(10))[0]}")
        elif isinstance(item, kinds.EvaluationEvent) and self.record.best is not None:
            self.curve.append(self.record.best)

    def draw(self) -> RenderableType:
        """The view, for a terminal of any width."""
        run, start, stage = self.record, self.record.start, self.record.stage
        seconds = time.monotonic() - self.started
        head = f"{start.task} · {start.workflow} · {start.model}" if start else "starting"
        name = self.ending or (stage.location.name if stage else "waiting")
        trajectories = stage.trajectories if stage else 0
        rate = f", {run.valid_calls / run.calls:.0%} valid" if run.calls else ""
        best = "-" if run.best is None else f"{run.best:.2f}"
        cost = "unknown" if self.cost is None else f"{self.cost:.4g}"
        lines: list[RenderableType] = [
            _one_line(head, "bold"),
            _one_line(
                f"{name} · {trajectories} trajectories · {run.evaluations} evaluations · "
                f"{seconds:.0f} s"
            ),
            _one_line(
                f"{_calls(run.calls, self.expected)}, {self.under_way} in progress{rate} · "
                f"{run.tokens} tokens · "
                f"cost {cost}"
            ),
            Text.assemble("best ", (best, "bold green"), "  ", (sparkline(self.curve), "green")),
        ]
        if (elites := Elites.of(run.archives)) is not None:
            lines.append(_one_line(_archive_line(elites)))
        if run.stages:
            lines.append(_stage_table(run.stages))
        lines += [_one_line(line, "dim") for line in self.failures]
        return Group(*lines)


def _calls(made: int, expected: int) -> str:
    """How many calls were made, and of about how many while there are fewer."""
    whole = counted(max(made, expected), "call")
    return f"{made} of about {whole}" if made < expected else whole


def _one_line(text: str, style: str = "") -> Text:
    """Text cut off at the terminal's width."""
    return Text(escape_controls(text), style=style, overflow="ellipsis", no_wrap=True)


def sparkline(values: list[float]) -> str:
    """A curve of at most `WIDEST` characters, from 0 (or the minimum) to the maximum."""
    if not values:
        return ""
    step = max(1, -(-len(values) // WIDEST))
    picked = values[::step]
    low, high = min(0.0, *values), max(values)
    scale = (len(BARS) - 1) / (high - low) if high > low else 0.0
    return "".join(BARS[round((value - low) * scale)] for value in picked)


def _archive_line(elites: Elites) -> str:
    classes = len(best_by_class(elites.cells.values()))
    return (
        f"archive: {len(elites.cells)} of {elites.size} cells, QD score {elites.qd_score:.2f}, "
        f"mechanism classes: {classes}"
    )


def _stage_table(rows: list[kinds.StageEvent]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("stage", "valid", "mean", "best"):
        table.add_column(name, justify="left" if name == "stage" else "right")
    for row in rows:
        valid = f"{row.valid}/{row.trajectories}"
        table.add_row(row.name, valid, number(row.mean), number(row.max))
    return table


def _refusal(event: kinds.AttemptEvent) -> str:
    """Why a reply was refused, in one line for people; the recorded problem is for the model."""
    for kind in (EMPTY, CUT_OFF, FILTERED):
        if event.code in kind.codes:
            return kind.name
    lines = event.problem.strip().split("\n")
    listed = lines[0].endswith(":") and len(lines) > 1
    reason = lines[1].removeprefix("- ") if listed else lines[0]
    return reason if event.parsed else reason.partition(";")[0]


EVERY_S = 30.0
"""Shortest time between two lines about calls and simulations, seconds."""


@dataclass
class PlainProgress(_Progress):
    """Progress where there is no terminal: a line per stage, and now and then one in between."""

    _told: float = field(default_factory=time.monotonic)
    _refused: str = ""
    """The last refusal that no line has told."""

    def note(self, event: kinds.RunEvent | Event) -> None:
        """Take in one event, and print what is worth a line."""
        if isinstance(event, kinds.RunStartEvent):  # the next of several runs
            self.record = RunRecord()
        self.record.add(event)
        if isinstance(event, kinds.AttemptEvent) and not event.valid:
            self._refused = f"; refused {event.label}: {_refusal(event)}"
        line = _line(event)
        if not line and time.monotonic() - self._told >= EVERY_S:
            run = self.record
            done = f"{_calls(run.calls, self.expected)}, {counted(run.evaluations, 'simulation')}"
            best = "" if run.best is None else f", best {number(run.best)}"
            begun = run.calls or run.evaluations
            line = f"{done}{best}{self._refused}" if begun else "waiting for the first reply"
            self._refused = ""
        if line:
            self._told = time.monotonic()
            print_line(line)


def _line(event: kinds.RunEvent | Event) -> str:
    """One line about an event that comes a few times in a run; "" for all others."""
    if isinstance(event, kinds.ProgramEvent):
        return f"{event.label}: {event}"
    if isinstance(event, kinds.StageEvent):
        return (
            f"stage {event.label}: {event.valid} of {event.trajectories} machines valid, "
            f"mean {number(event.mean)}, best {number(event.max)}"
        )
    if isinstance(event, kinds.StageBeginEvent):
        return f"stage {event.label} begins"  # a search may open more trajectories than set
    if isinstance(event, kinds.VerificationEvent):
        held = "" if event.holding is None else f", {event.holding}"
        return f"verified score {number(event.score)}{held}"
    if isinstance(event, kinds.DrawingEvent) and not any(event.frames):
        return "drawing pictures"
    if isinstance(event, kinds.RunStartEvent):
        return f"{event.task}, {event.workflow}, {event.model}"
    if isinstance(event, kinds.ConstructionEndEvent):
        return f"construction ends: {event.reason}"
    return ""
