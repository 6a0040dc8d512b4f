"""The list of runs, how the best score of each rose over time, and what changes, as events."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import AsyncIterator, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from math import inf
from pathlib import Path
from statistics import median
from threading import Lock
from time import monotonic, time
from typing import Any

from agentflow.app.design.plan import RunPlan, task_of_run
from agentflow.app.inspect.overview import run_details, run_row
from agentflow.app.pages.sweeps import run_states, sweep_page_data
from agentflow.app.sweeps.estimates import estimate
from agentflow.app.sweeps.folder import LOG, NAME, RUNS, is_sweep
from agentflow.app.sweeps.tables import record_of
from agentflow.config.run import PROCEDURAL
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.records import record_json, record_share
from agentflow.errors import AgentflowError, RunError, UsageError
from agentflow.runs import find_runs, read_document, state_of
from agentflow.runs.events import (
    EvaluationEvent,
    RunEvent,
    VerificationEvent,
    read_new_typed_events,
)
from agentflow.runs.locations import INITIAL, stage_words
from agentflow.runs.reading import AGAIN, CALLS, EVENTS, FILE_NAME, RESULT, Event
from agentflow.runs.record import RunRecord
from agentflow.studio.building.person_runs import PERSON
from agentflow.studio.folder import RunFolder
from agentflow.studio.watching.designs import Designs

Row = dict[str, Any]
Signature = tuple[object, ...]
EVERY_S = 0.7
"""Seconds between looks at the files."""
BY_HAND = "by hand"
"""What pages call the workflow of a person."""
BATCH_S = 0.15
"""Seconds after which the runs read so far are shown."""
DAY_S, START_S = 86_400.0, 1.5
"""Seconds of a day, and until the workers of a run have started."""
CORES = os.cpu_count() or 1
QUIET = 20
"""Looks without news after which a comment keeps the connection alive."""
News = Mapping[str, Any] | None
"""What one look has found; None without news."""


@dataclass
class Follower:
    """Follows the events of one run as they are written."""

    path: Path
    record: RunRecord = field(default_factory=RunRecord)
    at: float = 0.0
    """Seconds into the run at the last event."""
    best: str | None = None
    """Content hash of the machine with the highest score, or of the one that was chosen."""
    offset: int = 0
    """Bytes of the events that were read."""

    def new_points(self) -> list[dict[str, float]]:
        """The scores that have been added: seconds into the run, calls, tokens, steps, score.

        Raises:
            RunError: The events are damaged.
        """
        events, self.offset = read_new_typed_events(self.path, self.offset)
        return list(self._points(events))

    def _points(self, events: Iterable[RunEvent | Event]) -> Iterator[dict[str, float]]:
        for event in events:
            before = self.record.best
            self.record.add(event)
            self.at = max(self.at, event.at)
            if isinstance(event, EvaluationEvent) and event.score is not None:
                if self.record.best != before:
                    self.best = event.machine
                yield {"at": event.at, "score": event.score}
            elif isinstance(event, VerificationEvent):  # that of the chosen machine comes last
                self.best = event.machine


@dataclass
class _Known:
    """What is known of a run: its row, and the files that it was read from."""

    signature: Signature
    row: Row
    follower: Follower
    curve: list[tuple[float, float]]
    task: Task | None = None
    begun: float | None = None
    """When the run began, seconds since 1970; None until its run.yaml was read."""

    def learn(self, path: Path, document: Mapping[str, Any]) -> None:
        """Learn what a run's run.yaml says, which does not change."""
        recorded = document.get("began")
        self.begun = (
            datetime.fromisoformat(recorded).timestamp()
            if recorded
            else (path / FILE_NAME).stat().st_mtime  # of runs that did not record it
        )
        self.task = task_of_run(path, document)


class Listing:
    """The runs of a folder; those whose files have not changed are not read again."""

    def __init__(self, folder: RunFolder, designs: Designs | None = None) -> None:
        self._folder, self._designs = folder, designs
        self._known: dict[Path, _Known] = {}
        self._sweeps: dict[Path, tuple[Signature, Row]] = {}
        """Pages of sweeps, and the files and states of runs that they were made from."""
        self._lock = Lock()

    def rows(self) -> list[Row]:
        """Every run: see `look`."""
        return self.look()[0]

    def look(self, limit_s: float = inf) -> tuple[list[Row], int]:
        """The runs as `run_list` lists them, and their sweep, start, and best over time.

        A design that failed is among them, as `failed`, even if nothing is left of its run.

        Args:
            limit_s: Seconds for which runs are read, the newest first; at least one is.

        Returns:
            The rows, and how many runs are left to read.
        """
        with self._lock:
            runs = list(find_runs(self._folder.root)) if self._folder.root.is_dir() else []
            known = {path: self._known[path] for path in runs if path in self._known}
            changed = [
                path
                for path in sorted(runs, key=_last_change, reverse=True)
                if path not in known or known[path].signature != _signature(path)
            ]
            until, read = monotonic() + limit_s, 0
            for path in changed:
                if read and monotonic() > until:
                    break
                known[path], read = self._read(path), read + 1
            self._known = known
            return self._told(), len(changed) - read

    def pace(self, task: str) -> float:
        """How many times as long as `usual_seconds` a design takes on this computer now: the median
        of today's last three of the built-in model, if there are any on the same kind of task; else
        by how busy it is."""
        today = [
            (path, known)
            for path, known in list(self._known.items())
            if known.row["state"] == "done" and str(known.row["model"]).startswith(PROCEDURAL)
            if known.begun and not known.row["sweep"] and time() - known.begun < DAY_S
        ]
        family = task.partition("/")[0]
        like = [item for item in today if item[1].row["task"].partition("/")[0] == family]
        last = sorted(like or today, key=lambda item: item[1].begun or 0.0)[-3:]
        found = []
        for path, known in last:
            with suppress(AgentflowError):
                usual = usual_seconds(RunPlan.of_run(path, read_document(path)))
                found.append(known.row["seconds"] / usual)
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
        return median(found) if found else 1 + load / CORES

    def call_costs(self, model: str) -> dict[str, float | None]:
        """Mean `call_seconds` and `call_money` of a model in its last run; None if not known."""
        runs = [
            (known.begun or 0.0, path)
            for path, known in list(self._known.items())
            if known.row["model"] == model and known.row["calls"]
        ]
        seconds = money = None
        with suppress(AgentflowError, ValueError):  # of max: without runs
            spent = run_details(max(runs)[1])["spent"]["total"]
            seconds = spent["seconds"] / spent["calls"]
            money = None if spent["money"] is None else spent["money"] / spent["calls"]
        return {"call_seconds": seconds, "call_money": money}

    def record(self, path: Path) -> RunRecord:
        """The record of a finished run: the list's, if it has read all events and none replaces
        another, else read now."""
        known = self._known.get(path)
        with suppress(OSError):  # deleted meanwhile
            events = (path / EVENTS).read_bytes()
            if known and known.follower.offset == len(events) and AGAIN not in events:
                return known.follower.record
        return record_of(path)

    def sweep(self, path: Path) -> Row:
        """The data of a sweep's page, which are kept until a run begins or ends."""
        files = (path / NAME, path / LOG, *sorted((path / RUNS).glob(f"*/{RESULT}")))
        now = [(file, _last_change(file)) for file in files], run_states(path)
        before, data = self._sweeps.get(path, ((), {}))
        if before != now:
            data = sweep_page_data(path, self.record)
            self._sweeps[path] = now, data
        return data

    def _told(self) -> list[Row]:
        rows = {known.row["run"]: known.row for known in self._known.values()}
        for name, row in (self._designs.failed() if self._designs else {}).items():
            known = rows.get(name, row)
            if known["state"] in ("stopped", "failed"):
                rows[name] = {**known, "state": "failed", "problem": row["problem"]}
        return list(rows.values())

    def _read(self, path: Path) -> _Known:
        known = self._known.get(path) or _Known((), {}, Follower(path), [])
        known.signature = _signature(path)
        try:
            self._extend(known)
        except RunError:
            known.curve.clear()
        document = None
        with suppress(UsageError, ValueError):
            document = read_document(path)
            if known.begun is None:
                known.learn(path, document)
        row = run_row(path, document)
        verified = row["verified"]
        trusted = verified["score"] if verified else None
        score = row["score"] if trusted is None else trusted
        by_hand = {"workflow": BY_HAND, "state": _told_state(row["state"], row["model"])}
        known.row = {
            **row,
            **(by_hand if row["model"] == PERSON else {}),
            "unit": known.task.unit if known.task else "",
            "run": self._folder.name_of(path),
            "verified": trusted,
            "fragile": bool(verified and verified["fragile"]),
            "share": known.task and record_share(known.task, score),
            "record": known.task and record_json(known.task, score),
            "sweep": self._sweep_of(path),
            "begun": known.begun,
            "seconds": known.follower.at,
            "curve": known.curve,
            "machine": known.follower.best,
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


def _told_state(state: str, model: str | None) -> str:
    """A run of a person is open rather than running: it waits for tests."""
    return "open" if state == "running" and model == PERSON else state


def _last_change(path: Path) -> float:
    """When the files of a run were last added or replaced, as its folder tells."""
    try:
        return path.stat().st_mtime
    except OSError:  # deleted meanwhile
        return 0.0


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


async def as_stream(news: AsyncIterator[News]) -> AsyncIterator[str]:
    """News as text of server-sent events; an error is reported in the last one."""
    quiet = 0
    try:
        async for item in news:
            quiet = 0 if item is not None else quiet + 1
            if item is not None:
                yield _message(item)
            elif quiet % QUIET == 0:
                yield ": still here\n\n"
    except AgentflowError as error:
        yield _message({"problem": str(error), "ended": True})


async def follow_list(listing: Listing) -> AsyncIterator[News]:
    """All rows, as they are read, then those that have changed, and the names of those that are
    gone."""
    told: dict[str, Row] | None = None
    while True:
        found, left = await asyncio.to_thread(listing.look, BATCH_S)
        rows, before = {row["run"]: row for row in found}, told or {}
        changed = [row for name, row in rows.items() if before.get(name) != row]
        gone = [name for name in before if name not in rows]
        is_news = changed or gone or told is None
        yield {"rows": changed, "gone": gone, "left": left} if is_news else None
        told = rows
        await asyncio.sleep(0 if left else EVERY_S)


async def follow_run(path: Path, name: str, designs: Designs) -> AsyncIterator[News]:
    """The scores of one run so far, then each new one, its state and how far it is; ends when the
    run is complete or gone."""
    follower, told = Follower(path), Row()
    planned = await asyncio.to_thread(_planned, path)
    while True:
        problem = designs.problem(name)
        try:
            state: str = await asyncio.to_thread(state_of, path)  # first: no late event is missed
            points = await asyncio.to_thread(follower.new_points)
        except RunError:
            if path.exists():
                raise
            problem = await designs.end_of(name)
            why = problem or "the folder of this run was deleted"
            yield {**told, "state": "failed" if problem else "gone", "problem": why, "ended": True}
            return
        record, failing = follower.record, problem if state == "stopped" else ""
        model = record.start.model if record.start else None
        stage = record.stage and record.stage.location.name
        if stage and not record.evaluations:  # there is nothing to refine yet
            stage = INITIAL
        now = {
            "state": "failed" if failing else _told_state(state, model),
            "problem": failing,
            "best": record.best,
            "machine": follower.best,
            "stage": stage and stage_words(stage, model or ""),
            "calls": record.calls,
            "refused": record.calls - record.valid_calls,
            "simulations": len(record.machines),
            "retries": designs.retries(name),
            "seconds": follower.at,
            "planned": {} if model == PERSON else planned,
        }
        is_news = points or now != told
        yield {**now, "points": points, "ended": state == "done"} if is_news else None
        if state == "done":
            return
        told = now
        await asyncio.sleep(EVERY_S)


def usual_seconds(plan: RunPlan) -> float:
    """How long a run takes on an idle computer if its model answers at once."""
    return START_S + estimate(plan).worker_seconds / min(plan.config.workers, CORES)


def _planned(path: Path) -> Mapping[str, int]:
    """About how many calls and simulations a run needs; nothing if that cannot be said any more."""
    with suppress(AgentflowError):
        found = estimate(RunPlan.of_run(path, read_document(path)))
        return {"calls": found.calls, "simulations": found.rollouts}
    return {}


def _message(data: object) -> str:
    return f"data: {json.dumps(data, allow_nan=False)}\n\n"
