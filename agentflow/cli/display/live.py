"""Owns what is seen of a run while it runs: a live view on a terminal, plain lines without one.

Everything goes to stderr; standard output belongs to the result.
"""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agentflow.cli.display.text import escape_controls, number
from agentflow.runs import Event, Listener

Say = Callable[[str], None]
BARS = "▁▂▃▄▅▆▇█"
DRAWING = "drawing"
"""Kind of the event, shown and not recorded, that the pictures of the result are being made."""
BOOKKEEPING = frozenset(
    (
        *("refill", "beam", "candidate", "select", "expand", "node", "back_up", "query", "calls"),
        *("blueprint", "inspection", "edit", "search", "result"),
    )
)
"""Events of the record that repeat, for a reader, what an attempt or an evaluation has said."""


@contextmanager
def watch(quiet: bool) -> Iterator[tuple[Listener | None, Say]]:
    """What listens to a run, and where its remarks go, for as long as it runs.

    Quiet is without either: remarks are kept with the run, and an error says what it has to.
    """
    console = Console(stderr=True, highlight=False)
    if quiet:
        yield None, lambda _line: None
    elif console.is_terminal:
        progress = Progress()
        with Live(get_renderable=progress.draw, console=console, refresh_per_second=8) as live:
            yield progress.note, lambda line: console.print(Text(escape_controls(line)))
            live.transient = True  # the result says it all; a run that fails leaves its view
    else:
        yield _print_event, _complain


def _complain(line: str) -> None:
    _tell(f"agentflow: {line}")


def _tell(line: str) -> None:
    """Print to stderr; a run goes on when nobody is there to read."""
    with suppress(OSError, ValueError):
        print(escape_controls(line), file=sys.stderr, flush=True)


@dataclass
class Progress:
    """What a run has come to so far."""

    run: dict[str, Any] = field(default_factory=dict)
    stage: str = ""
    trajectories: int = 0
    calls: int = 0
    """Answered."""
    under_way: int = 0
    """Calls begun and not answered."""
    cost: float | None = 0.0
    """None when it is not known."""
    valid: int = 0
    tokens: int = 0
    rollouts: int = 0
    best: float | None = None
    curve: list[float] = field(default_factory=list)
    """Best score after each evaluation."""
    rows: list[dict[str, Any]] = field(default_factory=list)
    """Finished stages."""
    failures: deque[str] = field(default_factory=lambda: deque(maxlen=3))
    started: float = field(default_factory=time.monotonic)

    def note(self, event: Event) -> None:
        """Take in one event."""
        data = event.data
        if event.kind == "run":
            self.run = dict(data)
        elif event.kind == "stage_begin":
            self.stage, self.trajectories = event.label, data["trajectories"]
        elif event.kind == "calls":
            self.under_way, self.cost = data["under_way"], data["cost"]
        elif event.kind == DRAWING:
            self.stage = "drawing pictures"
        elif event.kind == "attempt":
            self.calls += 1
            self.valid += data["valid"]
            self.tokens += data["tokens"]
            if not data["valid"]:
                self.failures.append(f"{event.label}: {_first_line(data['problem'])}")
        elif event.kind == "evaluation":
            self._evaluated(data["score"])
        elif event.kind == "stage":
            self.rows.append(dict(data))

    def _evaluated(self, score: float | None) -> None:
        self.rollouts += 1
        if score is not None:
            self.best = score if self.best is None else max(self.best, score)
        if self.best is not None:
            self.curve.append(self.best)

    def draw(self) -> RenderableType:
        """The view, for a terminal of any width."""
        seconds = time.monotonic() - self.started
        head = " · ".join(str(self.run[key]) for key in ("task", "workflow", "model") if self.run)
        rate = f", {self.valid / self.calls:.0%} valid" if self.calls else ""
        best = "-" if self.best is None else f"{self.best:.2f}"
        cost = "unknown" if self.cost is None else f"{self.cost:.4g}"
        lines: list[RenderableType] = [
            _one_line(head or "starting", "bold"),
            _one_line(
                f"{self.stage or 'waiting'} · {self.trajectories} trajectories · "
                f"{self.rollouts} evaluations · {seconds:.0f} s"
            ),
            _one_line(
                f"{self.calls} calls, {self.under_way} under way{rate} · {self.tokens} tokens · "
                f"cost {cost}"
            ),
            Text.assemble("best ", (best, "bold green"), "  ", (sparkline(self.curve), "green")),
        ]
        if self.rows:
            lines.append(_stage_table(self.rows))
        lines += [_one_line(line, "dim") for line in self.failures]
        return Group(*lines)


def _one_line(text: str, style: str = "") -> Text:
    """Text that a narrow terminal cuts off."""
    return Text(escape_controls(text), style=style, overflow="ellipsis", no_wrap=True)


def sparkline(values: list[float], width: int = 40) -> str:
    """A curve in one line of at most `width` characters, from 0 (or the least) to the greatest."""
    if not values:
        return ""
    step = max(1, -(-len(values) // width))
    picked = values[::step]
    low, high = min(0.0, *values), max(values)
    scale = (len(BARS) - 1) / (high - low) if high > low else 0.0
    return "".join(BARS[round((value - low) * scale)] for value in picked)


def _stage_table(rows: list[dict[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("stage", "valid", "mean", "best"):
        table.add_column(name, justify="left" if name == "stage" else "right")
    for row in rows:
        cells = (f"{row['valid']}/{row['trajectories']}", number(row["mean"]), number(row["max"]))
        table.add_row(row["name"], *cells)
    return table


def _first_line(text: str) -> str:
    return text.strip().partition("\n")[0]


def _print_event(event: Event) -> None:
    if event.kind not in BOOKKEEPING:
        _tell(_line(event))


def _line(event: Event) -> str:
    data = event.data
    if event.kind == "attempt":
        return f"{event.label}: {'valid' if data['valid'] else _first_line(data['problem'])}"
    if event.kind == "evaluation":
        return f"{event.label}: {data['status']}, score {number(data['score'])}"
    if event.kind == "stage":
        return (
            f"stage {event.label}: {data['valid']} of {data['trajectories']} valid, "
            f"mean {number(data['mean'])}, best {number(data['max'])}"
        )
    if event.kind == "stage_begin":
        return f"stage {event.label} begins, {data['trajectories']} trajectories"
    if event.kind == DRAWING:
        return "drawing pictures"
    if event.kind == "run":
        return f"{data['task']}, {data['workflow']}, {data['model']}"
    return f"{event.kind} {event.label}"
