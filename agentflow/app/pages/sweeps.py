"""Reports of sweeps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import Any

from agentflow.app.design.plan import level_of_run, task_of_run
from agentflow.app.sweeps.folder import RUNS
from agentflow.app.sweeps.registry import HUMAN, LAYOUT, MECHANISMS, VERIFIED, VIEWS
from agentflow.app.sweeps.tables import (
    FinishedRun,
    SweepResult,
    layout_table,
    read_sweep_result,
    record_of,
)
from agentflow.app.sweeps.views import last_cell, variants
from agentflow.env.drawing.stills import png_url
from agentflow.env.tasks.records import record_json
from agentflow.env.tasks.registry import known_unit
from agentflow.errors import AgentflowError
from agentflow.machine import library, read_machine
from agentflow.report.page import require_writable, write_page
from agentflow.report.sweep import Spread, sweep_data
from agentflow.runs import read_document, state_of
from agentflow.runs.reading import FILE_NAME
from agentflow.runs.record import RunRecord

PICTURE = (320, 240)
"""Width and height of the pictures of the best machines, in pixels."""


def sweep_report(path: Path, out: Path, **_: Any) -> Path:
    """Write the page of a sweep, finished or not, to a file."""
    require_writable(out)
    data = sweep_page_data(path, pictures=True)
    write_page(out, f"{data['title']} · agentflow", data)
    return out


def sweep_page_data(
    path: Path, known: Callable[[Path], RunRecord] = record_of, *, pictures: bool = False
) -> dict[str, Any]:
    """The data of the page of a sweep, finished or not; with `pictures` of the best machines.
    `known` gives the record of a run."""
    result = read_sweep_result(path, known)
    views = {name: make(result) for name, make in VIEWS.items() if name != LAYOUT}
    for name in (HUMAN, VERIFIED, MECHANISMS):
        if not any(row.values[-1] is not None for row in views[name].rows):
            del views[name]
    tables = [layout_table(result, published=bool(result.sweep.table.published)), *views.values()]
    spreads = {key: _spread(result, runs, pictures) for key, runs in _groups(result).items()}
    data = sweep_data(result.sweep.title, result.sweep.about, spreads, tables, _runs(result))
    return {**data, "warning": _says_nothing(result, data["spreads"])}


def _says_nothing(result: SweepResult, spreads: Sequence[Mapping[str, Any]]) -> str:
    """Why the sweep says nothing about its conditions, if so; else ""."""
    labels = [each for axis in result.sweep.axes.values() for each in axis.values()]
    strategies = any("search.strategy" in key for each in labels for key in each)
    if strategies and not any(run.numbers.record.steps for run in result.finished):
        return (
            "No search round was made in any run, so this says nothing about the strategies: "
            "raise settings.max_simulations."
        )
    tasks = {each["task"]: each["values"] for each in spreads}
    if len(spreads) > len(tasks) and all(tasks[s["task"]] == s["values"] for s in spreads):
        return "All conditions have the same scores, so this says nothing about their differences."
    return ""


def _spread(result: SweepResult, runs: Sequence[FinishedRun], pictures: bool) -> Spread:
    """The scores of a group, the lowest first, with their runs, and its best machine."""
    cell = last_cell(result, runs)
    each = ((run.planned.name, replace(cell, runs=(run.numbers,))) for run in runs)
    found = sorted((score, name) for name, own in each for score in own.scores.all)
    unit = known_unit(runs[0].planned.config.task)
    best, goal = _best(runs, pictures), dict[str, Any]()
    with suppress(AgentflowError):  # a level that cannot be made here
        document = read_document(path := runs[0].path)
        task, good = task_of_run(path, document), level_of_run(path, document).file.good
        goal = {
            "level": task.name,
            "good": good,
            "record": record_json(task, best["score"] if best else None),
        }
    calls = fmean(run.numbers.record.calls for run in runs)
    return Spread(cell.scores, [name for _, name in found], unit, best, {**goal, "calls": calls})


def _groups(result: SweepResult) -> dict[tuple[str, str], list[FinishedRun]]:
    """Runs by task and, where they differ, by model and variant."""
    groups = variants(result)
    differing = [len(set(parts)) > 1 for parts in zip(*groups, strict=True)][1:]
    found = {}
    for (task, *rest), runs in groups.items():
        named = [part for part, differs in zip(rest, differing, strict=True) if differs]
        found[task, ", ".join(named)] = runs
    return found


def _best(runs: Sequence[FinishedRun], pictures: bool) -> dict[str, Any] | None:
    """The run with the best verified score, or score where there is none, and its machine."""
    scored = [run for run in runs if run.result.score is not None and run.result.machine]
    run = max(scored, key=lambda one: one.result.trusted_score or 0.0, default=None)
    machine = run and read_machine(run.result.machine, library()).machine
    if not (run and machine):
        return None
    drawn = png_url(machine, view="three-quarter", size=PICTURE) if pictures else None
    known = {"run": run.planned.name, "score": run.result.trusted_score, "picture": drawn}
    verified = run.result.verified_score is not None
    return {**known, "machine": machine.digest, "verified": verified}


def run_states(path: Path) -> dict[str, str]:
    """The state of each run of a sweep that has begun, by name."""
    return {
        file.parent.name: state_of(file.parent) for file in (path / RUNS).glob(f"*/{FILE_NAME}")
    }


def _runs(result: SweepResult) -> list[dict[str, Any]]:
    """Every run of the sweep: finished with its best score, failed with its reason, or as far as it
    is."""
    done = [
        {
            "name": run.planned.name,
            "state": "done",
            "score": run.result.score,
            "verified": (found := run.numbers.record.verification) and found.score,
            "fragile": bool(found and found.holding and found.holding.fragile),
        }
        for run in result.finished
    ]
    nothing = {"score": None, "verified": None, "fragile": False}
    states = run_states(result.path)
    return done + [
        {
            "name": name,
            "state": "failed" if name in result.failed else states.get(name, "not started"),
            **nothing,
            "why": result.failed.get(name, ""),
        }
        for name in result.missing
    ]
