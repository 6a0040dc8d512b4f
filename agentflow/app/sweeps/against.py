"""Differences between the conditions of a sweep or several, by pairs of runs with the same seed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from statistics import fmean
from typing import Any

from agentflow.app.sweeps import tables
from agentflow.app.sweeps.folder import is_sweep
from agentflow.config.grid import METRICS as TYPICAL
from agentflow.config.run import DesignConfig, build_config, changed_keys, differing_text
from agentflow.config.sweep import SweepConfig, SweepRun, TableLayout
from agentflow.errors import RunError, UnknownNameError, UsageError
from agentflow.metrics.cells import METRICS, Cell
from agentflow.metrics.intervals import Rate, bootstrap_mean, missing_scipy, seeds_needed
from agentflow.metrics.tables import Column, Row, Table, Value
from agentflow.runs import find_runs, read_document
from agentflow.runs.reading import RESULT

LAYOUT = TableLayout(conditions="none", metrics=TYPICAL)
"""Of runs without a sweep."""


def holds_runs(folder: Path) -> bool:
    """Whether a folder is a sweep, a run, or holds runs."""
    return is_sweep(folder) or next(find_runs(folder), None) is not None


def read_results(folders: Sequence[Path]) -> tables.SweepResult:
    """The finished runs of sweeps and of folders of runs.

    Variants of several folders that have the same task, model and labels are named after their
    folder, so that nothing is pooled across folders. The layout is that of the first sweep. A
    folder that is given twice counts once.

    Raises:
        RunError: Something is damaged, or a folder has no finished run.
    """
    folders = list({path.resolve(): path for path in folders}.values())
    found = [
        tables.read_sweep_result(path) if is_sweep(path) else _read_runs(path) for path in folders
    ]
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
    return tables.SweepResult(parts[0].path.parent, sweep, finished, planned, failed)


def _key(run: tables.FinishedRun, planned: SweepRun) -> tuple[str, ...]:
    return tables.task_of(planned), run.result.model, planned.variant


def _named(result: tables.SweepResult, folder: str, shared: bool) -> tables.SweepResult:
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


def _read_runs(folder: Path) -> tables.SweepResult:
    """The runs in a folder as a sweep whose variants are what differs between them."""
    paths = list(find_runs(folder))
    documents = [read_document(path) for path in paths]
    configs = [build_config(document.get("config")) for document in documents]
    planned = [
        SweepRun(path.relative_to(folder).as_posix(), labels, config)
        for path, labels, config in zip(paths, _labels(configs), configs, strict=True)
    ]
    finished = tuple(
        tables.finished_run(run, path, tables.record_of(path))
        for run, path in zip(planned, paths, strict=True)
        if (path / RESULT).exists()
    )
    if not finished:
        raise RunError(f"no run in {folder} is finished")
    tables.require_same_engine(folder, finished)
    seeds = tuple(dict.fromkeys(config.seed for config in configs))
    sweep = SweepConfig(title=folder.resolve().name, seeds=seeds, table=LAYOUT)
    return tables.SweepResult(folder, sweep, finished, tuple(planned), {})


def _labels(configs: Sequence[DesignConfig]) -> Iterator[Mapping[str, str]]:
    """Task, and workflow, engine and settings where they differ, of each run."""
    own = ("workflow", "engine")
    names = [name for name in own if len({getattr(config, name) for config in configs}) > 1]
    changed: list[dict[str, Any]] = [changed_keys(config) for config in configs]
    texts = differing_text(changed)
    for config, text in zip(configs, texts, strict=True):
        labels = {name: str(getattr(config, name)) for name in names}
        yield {"task": config.task, **labels, **({"settings": text} if text else {})}


FEW = 5
"""Fewer pairs have bootstrap intervals that are too narrow."""
MEANING = (
    "Each run gives one number, of all its machines; runs of one task with the same seed are a "
    "pair. difference: mean over pairs of condition - baseline, with its bootstrap interval over "
    "pairs (10,000 resamples). higher: pairs in which the condition has the higher number. seeds "
    "needed: about how many seeds show a difference of this size, so that its interval leaves out "
    "0 in four of five sweeps."
)


@dataclass(frozen=True)
class _Side:
    """What one number of a difference is computed from."""

    run: tables.FinishedRun
    stage: str
    rounds: int | None = None

    def number(self, metric: str) -> float | None:
        """The metric of this run alone; None where it is not a number."""
        with METRICS.blaming(metric):
            value = METRICS[metric].of(Cell((self.run.numbers,), self.stage, self.rounds))
        value = value.value if isinstance(value, Rate) else value
        return float(value) if isinstance(value, float | int) else None


_Sides = Mapping[str, Mapping[int, _Side]]
"""Condition -> seed -> side."""


def against_table(result: tables.SweepResult, baseline: str) -> Table:
    """How the metrics of each condition differ from those of one of them.

    Conditions are the variants of the sweep, or the stages or rounds that its table compares.

    Raises:
        UnknownNameError: The sweep has no such condition.
        UsageError: It has no other condition, or no run of this one is finished.
    """
    found = _groups(result, baseline)
    if not any(baseline in sides for sides in found.values()):
        raise UsageError(f"no run of the condition {baseline!r} is finished")
    layout = result.sweep.table
    rows, fewest, apart = [], 0, False
    for (task, variant), sides in found.items():
        for condition in filter(lambda name: name != baseline, sides):
            pairs = _pairs(sides[baseline], sides[condition]) if baseline in sides else []
            same = [(one, other) for one, other in pairs if one.run.engine == other.run.engine]
            apart |= len(same) < len(pairs)
            for metric in layout.task_metrics.get(task, layout.metrics):
                numbers = [(one.number(metric), other.number(metric)) for one, other in same]
                known = [(a, b) for a, b in numbers if a is not None and b is not None]
                if known:
                    fewest = min(fewest or len(known), len(known))
                label = ", ".join(filter(None, [variant, condition]))
                rows.append(Row((task, label, metric), _difference(known)))
    return Table(
        f"{result.sweep.title}: differences from {baseline}",
        ("task", "condition", "metric"),
        (
            Column("", "pairs"),
            *(Column("mean", name) for name in (baseline, "condition")),
            *(Column("difference", name) for name in ("mean", "95 %")),
            *(Column("", name) for name in ("higher", "seeds needed")),
        ),
        tuple(rows),
        notes=(
            *result.notes[1:],
            MEANING,
            *tables.identity_notes(dict.fromkeys(row.labels[2] for row in rows)),
            *([f"Intervals of fewer than {FEW} pairs are too narrow."] * (0 < fewest < FEW)),
            *(["Runs of different engines are no pair."] * apart),
            *filter(None, [missing_scipy()]),
        ),
    )


def _difference(pairs: Sequence[tuple[float, float]]) -> tuple[Value, ...]:
    """The values of a row, from (baseline, condition) of each pair."""
    if not pairs:
        return 0, *[None] * 6
    apart = [other - one for one, other in pairs]
    return (
        len(pairs),
        *(fmean(side) for side in zip(*pairs, strict=True)),
        fmean(apart),
        bootstrap_mean(apart),
        Rate(sum(value > 0 for value in apart), len(apart)),
        seeds_needed(apart),
    )


def _pairs(one: Mapping[int, _Side], other: Mapping[int, _Side]) -> list[tuple[_Side, _Side]]:
    return [(one[seed], other[seed]) for seed in one if seed in other]


def _groups(
    result: tables.SweepResult, baseline: str
) -> dict[tuple[str, str], dict[str, dict[int, _Side]]]:
    """(task, variant) -> the sides of each condition; variants are themselves conditions, "" then,
    unless the baseline is a stage or a number of rounds."""
    layout = result.sweep.table
    variants = tuple(dict.fromkeys(run.variant for run in result.planned))
    within = () if layout.conditions in ("axes", "none") else tables.conditions(result)
    known = tuple(filter(None, (*variants, *within)))
    if baseline not in known:
        raise UnknownNameError("condition", baseline, known)
    if len(within if baseline in within else variants) < 2:
        raise UsageError(f"the sweep has no other condition than {baseline!r}")
    found: dict[tuple[str, str], dict[str, dict[int, _Side]]] = {}
    seen: dict[tuple[str, str, int], str] = {}
    for run in result.finished:
        task, seed = tables.task_of(run.planned), run.planned.config.seed
        twin = seen.setdefault((task, run.planned.variant, seed), run.planned.name)
        if twin != run.planned.name:
            raise UsageError(
                f"{twin} and {run.planned.name} have the same task, condition and seed, so "
                "--against cannot tell which is whose pair: move one of them elsewhere"
            )
        variant = run.planned.variant
        if baseline in variants:
            group, sides = (task, ""), {variant: _Side(run, layout.stage)}
        elif layout.conditions == "rounds":
            counts = zip(within, layout.rounds, strict=True)
            group = task, variant
            sides = {name: _Side(run, layout.stage, count) for name, count in counts}
        else:
            group, sides = (task, variant), {name: _Side(run, name) for name in within}
        for name, side in sides.items():
            found.setdefault(group, {}).setdefault(name, {})[seed] = side
    return found
