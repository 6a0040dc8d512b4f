"""The list of runs in a folder, the details of one run, and what today's rules say of its
machines."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from agentflow.app.design.config import config_json
from agentflow.app.design.execution import best_machine
from agentflow.app.design.plan import task_of_run
from agentflow.app.inspect.failures import count_failures
from agentflow.config.run import build_config, changed_keys
from agentflow.env.archive import load_npz
from agentflow.env.tasks.records import record_json
from agentflow.errors import RunError, UsageError
from agentflow.holding import with_holding
from agentflow.machine import Brief, Machine, check
from agentflow.machine.problems import LATER_RULES
from agentflow.metrics.usage import summarize_usage
from agentflow.models.choices import cost_function
from agentflow.runs import RunResult, find_runs, read_calls, read_document, read_result, state_of
from agentflow.runs.events import read_typed_events
from agentflow.runs.record import RunRecord


def later_note(machine: Machine, brief: Brief) -> str:
    """Why a recorded machine would now be refused, by rules that came after its run; or ""."""
    found = [item for item in check(machine, brief).problems if item.code in LATER_RULES]
    if not found:
        return ""
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"would now be refused: {found[0].message}{more}"


def run_list(folder: Path) -> Iterator[dict[str, Any]]:
    """List the runs in a folder and its subfolders.

    Each is `run`, `state` (done, running, stopped, damaged), `task`, `workflow`, `model`, `seed`,
    `engine` (name and version), `score`, `verified` (see `with_holding`; None if the best machine
    was not verified), `calls`, `cost`, `settings` (see `changed_keys`), `problem` (why it is
    damaged, or empty).
    """
    if not folder.is_dir():
        raise RunError(f"no such directory: {folder}")
    yield from map(run_row, find_runs(folder))


def run_row(path: Path, document: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """One run as `run_list` lists it; `document` is its run.yaml, if that has been read."""
    try:
        return _summary(*_read(path, document))
    except UsageError as error:
        return _row(path, "damaged", {}, str(error))


def _row(path: Path, state: str, result: Mapping[str, Any], problem: str = "") -> dict[str, Any]:
    keys = ("task", "workflow", "model", "seed", "engine", "score", "verified", "calls", "cost")
    known = {key: result.get(key) for key in keys}
    known["verified"] = with_holding(known["verified"])
    settings = result.get("settings") or {}
    return {"run": str(path), "state": state, **known, "settings": settings, "problem": problem}


def _read(
    path: Path, document: Mapping[str, Any] | None = None
) -> tuple[Path, str, Mapping[str, Any], RunResult | None]:
    """A run with its state, the content of its run.yaml, and its result if it is finished."""
    state, document = state_of(path), read_document(path) if document is None else document
    return path, state, document, read_result(path) if state == "done" else None


def _summary(
    path: Path, state: str, document: Mapping[str, Any], result: RunResult | None
) -> dict[str, Any]:
    known = _result_so_far(path, document) if result is None else result.to_json()
    changed = changed_keys(build_config(document.get("config")))
    return _row(path, state, {**known, "engine": document.get("engine"), "settings": changed})


def _result_so_far(path: Path, document: Mapping[str, Any]) -> dict[str, Any]:
    config = build_config(document.get("config"))
    record = RunRecord.of(read_typed_events(path))
    return {
        "task": config.task,
        "workflow": config.workflow,
        "model": record.start.model if record.start else config.model.name,
        "seed": config.seed,
        "score": record.best,
        "calls": sum(1 for _ in read_calls(path)),
    }


SHOWN = ("most_blocks", "best_stage", "robust", "front", "makers", "finalists")
"""Keys of result.json that the details of a run have."""


def run_details(path: Path) -> dict[str, Any]:
    """One run in detail.

    The keys of `run_list` and `blocks`, `most_blocks`, `best_stage`, `robust`, `front`, `makers`
    and `finalists` (as in result.json; None unless the objective or the search has them),
    `marginal` (connections of the best machine as in `rollout_json`; None if its rollout was not
    saved), `record` (see `record_json`, with the share that the run reached), `stages` (rows of the
    stage table),
    `stopped`, `reason`, `spent` (calls, tokens, seconds and money by role), `failures` (see
    `count_failures`), `remarks`, `config`, and the rest of run.yaml.
    """
    _, state, document, result = _read(path)
    summary = _summary(path, state, document, result)
    known = {} if result is None else result.to_json()
    record = RunRecord.of(read_typed_events(path))
    config = build_config(document.get("config"))
    spent = summarize_usage(read_calls(path), cost_function(config.model))
    machine = best_machine(result)
    return {
        **{key: value for key, value in document.items() if key != "schema"},
        **summary,
        "config": config_json(config),
        "blocks": known.get("blocks", len(machine) if machine else None),
        **{key: known.get(key) for key in SHOWN},
        "record": reached(path, document, result.trusted_score if result else summary["score"]),
        "marginal": _marginal(path, machine),
        "stages": [stage.data for stage in record.stages],
        "stopped": known.get("stopped"),
        "reason": known.get("reason", ""),
        "spent": {
            role: {**asdict(item), "tokens": item.tokens}
            for role, item in {"total": spent.total, **spent.roles}.items()
        },
        "failures": count_failures(path),
        "remarks": [*record.remarks, *_later_notes(machine, path, document)],
    }


def reached(path: Path, document: Mapping[str, Any], score: float | None) -> dict[str, Any] | None:
    """The record of a run's task and the share of it that a score reaches, see `record_json`.

    Returns:
        None without a record, or if the task is not installed.
    """
    with suppress(UsageError):
        return record_json(task_of_run(path, document), score)
    return None


def _marginal(path: Path, machine: Machine | None) -> list[dict[str, Any]] | None:
    """Connections of the best machine that nearly broke; None if its rollout was not saved."""
    with suppress(UsageError):
        if machine:
            rollout = load_npz(path / "rollouts" / f"{machine.digest}.npz")
            return [asdict(item) for item in rollout.marginal]
    return None


def _later_notes(machine: Machine | None, path: Path, document: Mapping[str, Any]) -> list[str]:
    """Why the best machine would now be refused; nothing if its task is not installed."""
    with suppress(UsageError):
        if machine and (note := later_note(machine, task_of_run(path, document).brief)):
            return [f"the best machine {note}"]
    return []
