"""Several sweeps, and folders of runs that belong to none, as one sweep that tables compare."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from agentflow.app.sweeps.folder import is_sweep
from agentflow.app.sweeps.tables import (
    FinishedRun,
    SweepResult,
    finished_run,
    read_sweep_result,
    require_same_engine,
    task_of,
)
from agentflow.config.grid import METRICS
from agentflow.config.run import DesignConfig, build_config, changed_keys, differing_text
from agentflow.config.sweep import SweepConfig, SweepRun, TableLayout
from agentflow.errors import RunError
from agentflow.runs import find_runs, read_document
from agentflow.runs.reading import RESULT

LAYOUT = TableLayout(conditions="none", metrics=METRICS)
"""Of runs without a sweep."""


def holds_runs(folder: Path) -> bool:
    """Whether a folder is a sweep, a run, or holds runs."""
    return is_sweep(folder) or next(find_runs(folder), None) is not None


def read_results(folders: Sequence[Path]) -> SweepResult:
    """The finished runs of sweeps and of folders of runs.

    Variants of several folders that have the same task, model and labels are named after their
    folder, so that nothing is pooled across folders. The layout is that of the first sweep. A
    folder that is given twice counts once.

    Raises:
        RunError: Something is damaged, or a folder has no finished run.
    """
    folders = list({path.resolve(): path for path in folders}.values())
    found = [read_sweep_result(path) if is_sweep(path) else _read_runs(path) for path in folders]
    if len(found) == 1:
        return found[0]
    keys = [{_key(run, run.planned) for run in result.finished} for result in found]
    shared = sum(map(len, keys)) > len(set().union(*keys))
    names = [path.resolve().name for path in folders]
    if len(set(names)) < len(names):
        names = list(map(str, folders))
    parts = [_named(*pair, shared) for pair in zip(found, names, strict=True)]
    layout = next((part.sweep.table for part in parts if part.sweep.axes), parts[0].sweep.table)
    sweep = SweepConfig(
        title=" and ".join(dict.fromkeys(part.sweep.title for part in parts)),
        seeds=tuple(dict.fromkeys(chain.from_iterable(part.sweep.seeds for part in parts))),
        axes={
            f"{folder} {name}": axis
            for folder, part in zip(names, parts, strict=True)
            for name, axis in part.sweep.axes.items()
        },
        table=layout,
    )
    finished = tuple(chain.from_iterable(part.finished for part in parts))
    planned = tuple(chain.from_iterable(part.planned for part in parts))
    failed = {name: why for part in parts for name, why in part.failed.items()}
    return SweepResult(parts[0].path.parent, sweep, finished, planned, failed)


def _key(run: FinishedRun, planned: SweepRun) -> tuple[str, ...]:
    return task_of(planned), run.result.model, planned.variant


def _named(result: SweepResult, folder: str, shared: bool) -> SweepResult:
    """The result with its folder in the names of its runs and, if `shared`, in their labels."""

    def rename(planned: SweepRun) -> SweepRun:
        labels = {"sweep": folder, **planned.labels} if shared else planned.labels
        return replace(planned, name=f"{folder}/{planned.name}", labels=labels)

    return replace(
        result,
        finished=tuple(replace(run, planned=rename(run.planned)) for run in result.finished),
        planned=tuple(map(rename, result.planned)),
        failed={f"{folder}/{name}": why for name, why in result.failed.items()},
    )


def _read_runs(folder: Path) -> SweepResult:
    """The runs in a folder as a sweep whose variants are what differs between them."""
    paths = list(find_runs(folder))
    documents = [read_document(path) for path in paths]
    configs = [build_config(document.get("config")) for document in documents]
    planned = [
        SweepRun(path.relative_to(folder).as_posix(), labels, config)
        for path, labels, config in zip(paths, _labels(configs), configs, strict=True)
    ]
    finished = tuple(
        finished_run(run, path)
        for run, path in zip(planned, paths, strict=True)
        if (path / RESULT).exists()
    )
    if not finished:
        raise RunError(f"no run in {folder} is finished")
    require_same_engine(folder, finished)
    seeds = tuple(dict.fromkeys(config.seed for config in configs))
    sweep = SweepConfig(title=folder.resolve().name, seeds=seeds, table=LAYOUT)
    return SweepResult(folder, sweep, finished, tuple(planned), {})


def _labels(configs: Sequence[DesignConfig]) -> Iterator[Mapping[str, str]]:
    """Task, and workflow, engine and settings where they differ, of each run."""
    own = ("workflow", "engine")
    names = [name for name in own if len({getattr(config, name) for config in configs}) > 1]
    changed: list[dict[str, Any]] = [changed_keys(config) for config in configs]
    texts = differing_text(changed)
    for config, text in zip(configs, texts, strict=True):
        labels = {name: str(getattr(config, name)) for name in names}
        yield {"task": config.task, **labels, **({"settings": text} if text else {})}
