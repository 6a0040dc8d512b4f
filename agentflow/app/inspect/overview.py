"""Owns how recorded runs are looked at: the list of a folder, and one run with what it holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from agentflow.app.design.prices import cost_by
from agentflow.app.design.remarks import REMARK
from agentflow.app.design.results import finished
from agentflow.app.inspect.failures import count_failures
from agentflow.app.inspect.reading import sound
from agentflow.config.run import DesignConfig, build
from agentflow.errors import RunError, UsageError
from agentflow.metrics.usage import Spent, bill
from agentflow.runs import find_runs, read_calls, read_document, read_events, state_of


def run_list(folder: Path) -> Iterator[dict[str, Any]]:
    """The runs in a folder and its subfolders, one after the other.

    Each is `run`, `state` (done, running, stopped, damaged), `task`, `workflow`, `model`, `seed`,
    `score`, `calls`, `cost`, `problem` (why it is damaged, else empty).

    Raises:
        RunError: There is no such folder.
    """
    if not folder.is_dir():
        raise RunError(f"there is no folder {folder}")
    for path in find_runs(folder):
        try:
            yield _summary(path)
        except UsageError as error:
            yield {**_NOTHING, "run": str(path), "state": "damaged", "problem": str(error)}


_NOTHING: dict[str, Any] = {
    "run": "",
    "state": "",
    "task": None,
    "workflow": None,
    "model": None,
    "seed": None,
    "score": None,
    "calls": None,
    "cost": None,
    "problem": "",
}


_ROW = ("name", "trajectories", "valid_first", "valid", "mean", "max", "calls", "rollouts")
"""What a row of the stage table holds at least."""


def _summary(path: Path) -> dict[str, Any]:
    state, document = state_of(path), read_document(path)
    known = finished(path) if state == "done" else _so_far(path, build(document.get("config")))
    found = {key: known.get(key) for key in _NOTHING}
    return {**found, "run": str(path), "state": state, "problem": ""}


def _so_far(path: Path, config: DesignConfig) -> dict[str, Any]:
    """What an unfinished run has come to."""
    found: dict[str, Any] = {
        "task": config.task,
        "workflow": config.workflow,
        "model": config.model.name,
        "seed": config.seed,
    }
    best: float | None = None
    with sound(path):
        for event in read_events(path):
            if event.kind == "run":
                found["model"] = event.data["model"]
            score = event.data.get("score") if event.kind == "evaluation" else None
            if score is not None:
                best = score if best is None else max(best, score)
    return {**found, "score": best, "calls": sum(1 for _ in read_calls(path))}


def run_details(path: Path) -> dict[str, Any]:
    """One run: the keys of `run_list`, and what is known of how it came about.

    Besides: `blocks`, `best_stage`, `stages` (rows of the stage table), `stopped`, `reason`,
    `spent` (calls, tokens, seconds and money by role), `failures` (see `count_failures`),
    `remarks`, `config`, and what else run.yaml says.

    Raises:
        RunError: It is no run, or damaged.
    """
    document = read_document(path)
    summary = _summary(path)
    result = finished(path) if summary["state"] == "done" else {}
    stages, remarks = [], []
    with sound(path):
        for event in read_events(path):
            if event.kind == "stage":
                stages.append({key: event.data[key] for key in (*_ROW, *event.data)})
            elif event.kind == REMARK:
                remarks.append(event.data["text"])
    spent = bill(read_calls(path), cost_by(build(document.get("config")).model))
    machine = result.get("machine")
    return {
        **summary,
        "blocks": len(machine) if machine else None,
        "best_stage": result.get("best_stage"),
        "stages": stages,
        "stopped": result.get("stopped"),
        "reason": result.get("reason", ""),
        "spent": {
            "total": _spent(spent.total),
            **{role: _spent(item) for role, item in spent.roles.items()},
        },
        "failures": count_failures(path),
        "remarks": remarks,
        **{key: value for key, value in document.items() if key != "schema"},
    }


def _spent(item: Spent) -> dict[str, Any]:
    return {**asdict(item), "tokens": item.tokens}
