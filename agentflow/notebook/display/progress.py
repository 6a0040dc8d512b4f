"""The progress of runs and sweeps, as one line of a notebook that is rewritten."""

from __future__ import annotations

import time
from html import escape
from typing import Any

from agentflow.metrics.formats import counted
from agentflow.notebook.display.formatters import in_notebook
from agentflow.runs import Event, Listener, Notify, RunResult
from agentflow.runs.events import RunEvent
from agentflow.runs.record import RunRecord

PAUSE = 0.3
"""Least seconds between two changes, so that notebooks stay small and quick."""


class Line:
    """A line that is rewritten, with a bar where it is known how much there is to do."""

    def __init__(self) -> None:
        self._shown: Any = None
        self._last = 0.0

    def show(self, text: str, done: int = 0, of: int = 0, *, at_once: bool = False) -> None:
        """Rewrite the line, unless that was just done."""
        now = time.monotonic()
        if not at_once and now - self._last < PAUSE:
            return
        self._last = now
        bar = f'<progress value="{done}" max="{of}"></progress> ' if of else ""
        content = {"text/html": f"<small>{bar}{escape(text)}</small>", "text/plain": text}
        if self._shown is None:
            from IPython.display import display

            show: Any = display  # has no types
            self._shown = show(content, raw=True, display_id=True)
        else:
            self._shown.update(content, raw=True)


class RunLine:
    """Shows a run: its stage, calls, machines and best score."""

    def __init__(self) -> None:
        self._line, self._record = Line(), RunRecord()

    def __call__(self, event: RunEvent | Event) -> None:
        """Take in an event."""
        if not isinstance(event, RunEvent):
            return
        self._record.add(event)
        record, ended = self._record, event.kind == "result"
        best = "" if record.best is None else f", best score {record.best:.4g}"
        stage = "done" if ended else record.stage.location.name if record.stage else "begun"
        numbers = f"{counted(record.calls, 'call')}, {counted(len(record.machines), 'machine')}"
        self._line.show(f"{stage.replace('_', ' ')}: {numbers}{best}", at_once=ended)


class SweepLine:
    """Shows a sweep: how many runs are done, and the best score; outside of notebooks, remarks."""

    def __init__(self, of: int, say: Notify) -> None:
        """`of` is the number of runs; `say` gets remarks and failures outside of notebooks."""
        self._line, self._of, self._done, self._say = Line(), of, 0, say
        self._shown = in_notebook()
        self._best: float | None = None

    def run_started(self, run: str) -> None:
        """A run was started or resumed."""
        self._tell(f"{run} has begun")

    def event(self, run: str, event: RunEvent | Event) -> None:
        """Events of runs are not shown."""

    def remark(self, run: str, line: str) -> None:
        """A line of text from a run for the user."""
        self._remark(f"{run}: {line}")

    def run_finished(self, run: str, result: RunResult) -> None:
        """A run is finished."""
        scores = [score for score in (self._best, result.score) if score is not None]
        self._done, self._best = self._done + 1, max(scores, default=None)
        self._tell(f"{run} is done", at_once=self._done == self._of)

    def run_failed(self, run: str, reason: str) -> None:
        """A run has failed."""
        self._remark(f"{run} has failed: {reason}")

    def _remark(self, text: str) -> None:
        if self._shown:
            self._tell(text, at_once=True)
        else:
            self._say(text)

    def _tell(self, what: str, *, at_once: bool = False) -> None:
        if self._shown:
            best = "" if self._best is None else f", best score {self._best:.4g}"
            text = f"{self._done} of {self._of} runs{best}; {what}"
            self._line.show(text, self._done, self._of, at_once=at_once)


def run_listener(given: Listener | None) -> Listener | None:
    """The listener of a run: the given one, or in a notebook a line of progress."""
    return given or (RunLine() if in_notebook() else None)
