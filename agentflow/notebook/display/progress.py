"""The progress of runs and sweeps, as one line of a notebook that is rewritten."""

import time
from html import escape
from typing import Any

from agentflow.metrics.tables import counted, number
from agentflow.notebook.display.formatters import in_notebook
from agentflow.runs import Event, Listener, Notify, RunResult
from agentflow.runs.events import RunEvent
from agentflow.runs.record import RunRecord

PAUSE = 0.3
"""Least seconds between two changes, so that notebooks stay small and quick."""
ENDINGS = {"result": "workflow done", "verification": "best machine verified"}
"""Kind of event -> what a run has then reached."""


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
        record = self._record
        record.add(event)
        ending = ENDINGS.get(event.kind)
        stage = record.stage.location.name.replace("_", " ") if record.stage else "starting"
        best = "" if record.best is None else f", best score {number(record.best)}"
        numbers = f"{counted(record.calls, 'call')}, {counted(len(record.machines), 'machine')}"
        self._line.show(f"{ending or stage}: {numbers}{best}", at_once=ending is not None)


class SweepLine:
    """Shows in a notebook how many runs of a sweep are done, and the best score."""

    def __init__(self, of: int, say: Notify, listener: Listener | None = None) -> None:
        """`of` is the number of runs; `say` gets remarks and failures, `listener` all events."""
        self._line = Line() if in_notebook() else None
        self._of, self._done, self._say, self._listener = of, 0, say, listener
        self._best: float | None = None

    def run_started(self, run: str) -> None:
        """A run was started or resumed."""
        self._show(f"{run} has begun")

    def event(self, _run: str, event: RunEvent | Event) -> None:
        """An event of a run."""
        if self._listener is not None:
            self._listener(event)

    def remark(self, run: str, line: str) -> None:
        """A line of text from a run for the user."""
        self._say(f"{run}: {line}")

    def run_finished(self, run: str, result: RunResult) -> None:
        """A run is finished."""
        scores = [score for score in (self._best, result.score) if score is not None]
        self._done, self._best = self._done + 1, max(scores, default=None)
        self._show(f"{run} is done", at_once=self._done == self._of)

    def run_failed(self, run: str, reason: str) -> None:
        """A run has failed."""
        self._say(f"{run} has failed: {reason}")

    def _show(self, what: str, *, at_once: bool = False) -> None:
        if self._line is not None:
            best = "" if self._best is None else f", best score {number(self._best)}"
            text = f"{self._done} of {self._of} runs{best}; {what}"
            self._line.show(text, self._done, self._of, at_once=at_once)


def run_listener(given: Listener | None) -> Listener | None:
    """The listener of a run: the given one, or in a notebook a line of progress."""
    return given or (RunLine() if in_notebook() else None)
