"""Results of sweeps, and their table in the published layout."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from shlex import quote

from agentflow.app.sweeps.folder import RUNS, read_failures, read_folder
from agentflow.app.sweeps.unread import unread_note, unused_note
from agentflow.config.sweep import SweepConfig, SweepRun, list_runs
from agentflow.env.tasks.records import full_score, other_recorders
from agentflow.env.tasks.registry import get_task
from agentflow.errors import RunError, UsageError
from agentflow.llm.procedural import ProceduralClient
from agentflow.metrics import published as literature
from agentflow.metrics.cells import METRICS, Cell, RunNumbers
from agentflow.metrics.tables import Column, Row, Table, Value, counted
from agentflow.runs import RunResult, read_document, read_result
from agentflow.runs.events import read_typed_events
from agentflow.runs.locations import STAGES
from agentflow.runs.reading import RESULT
from agentflow.runs.record import RunRecord
from agentflow.workflows.registry import WORKFLOWS


@dataclass(frozen=True)
class FinishedRun:
    """One finished run of a sweep.

    `engine` is the name and version of its physics engine.
    """

    planned: SweepRun
    path: Path
    result: RunResult
    engine: str
    numbers: RunNumbers


@dataclass(frozen=True)
class SweepResult:
    """The finished runs of a sweep.

    `planned` are all of its runs, finished or not, in order; `failed` maps the name of each failed
    run to the reason.
    """

    path: Path
    sweep: SweepConfig
    finished: tuple[FinishedRun, ...]
    planned: tuple[SweepRun, ...]
    failed: Mapping[str, str]

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the unfinished runs."""
        done = {run.planned.name for run in self.finished}
        return tuple(planned.name for planned in self.planned if planned.name not in done)

    @property
    def tasks(self) -> tuple[str, ...]:
        """Tasks of all runs, in order."""
        return tuple(dict.fromkeys(task_of(planned) for planned in self.planned))

    @property
    def engines(self) -> tuple[str, ...]:
        """The physics engines of the finished runs."""
        return tuple(dict.fromkeys(run.engine for run in self.finished))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes under every table."""
        seeds = len(self.sweep.seeds)
        pooled = f"{seeds} seeds, pooled" if seeds > 1 else "1 seed"
        notes = [f"{counted(len(self.finished), 'run')}; {pooled}."]
        if self.missing:
            total = len(self.finished) + len(self.missing)
            failed = sum(name in self.failed for name in self.missing)
            notes.append(
                f"INCOMPLETE: {len(self.missing)} of {total} runs are missing, "
                f"{failed} of them failed."
            )
        only = "; no number is of more than one" if len(self.engines) > 1 else ""
        notes.append(f"Physics engine: {', '.join(self.engines)}{only}.")
        notes += filter(None, [unused_note(self.sweep)])
        if any(run.result.model == ProceduralClient.name for run in self.finished):
            notes += filter(None, [unread_note(self.sweep)])
        return tuple(notes)


def task_of(planned: SweepRun) -> str:
    """The name of the task in tables: its axis label if there is one, else the configured name."""
    return planned.labels.get("task", planned.config.task)


def record_of(path: Path) -> RunRecord:
    """The record of a run, read from its events."""
    return RunRecord.of(read_typed_events(path))


def read_sweep_result(path: Path, known: Callable[[Path], RunRecord] = record_of) -> SweepResult:
    """Read the finished runs of a sweep; `known` gives the record of a run.

    Raises:
        RunError: It is not a sweep directory, it or a run is damaged, no run is finished, or runs
            that differ only in the seed were made with different engines.
    """
    _, sweep = read_folder(path)
    done: list[FinishedRun] = []
    every = list_runs(sweep)
    for planned in every:
        run = path / RUNS / planned.name
        if (run / RESULT).exists():
            done.append(finished_run(planned, run, known(run)))
    if not done:
        raise RunError(
            f"no run of {path} is finished yet; unless it is running now, go on with "
            f"agentflow {sweep.command} {quote(str(path))} --resume"
        )
    require_same_engine(path, done)
    return SweepResult(path, sweep, tuple(done), every, read_failures(path))


def finished_run(planned: SweepRun, path: Path, record: RunRecord) -> FinishedRun:
    """A finished run with its record, which was planned as this one."""
    config = planned.config
    width = WORKFLOWS[config.workflow].adapt(config.settings).search.children
    full = _full_score(config.task, json.dumps(config.knobs, sort_keys=True))
    found = read_result(path)
    engine = found.engine or read_document(path).get("engine", "not recorded")
    return FinishedRun(planned, path, found, engine, RunNumbers(record, width, full, path))


def require_same_engine(path: Path, runs: Iterable[FinishedRun]) -> None:
    """Raise RunError if the seeds of a variant, which are pooled, have different engines."""
    firsts: dict[tuple[str, ...], FinishedRun] = {}
    for run in runs:
        first = firsts.setdefault(tuple(run.planned.labels.values()), run)
        if first.engine != run.engine:
            raise RunError(
                f"{path}: {first.planned.name} was made with {first.engine} but "
                f"{run.planned.name} with {run.engine}, so they cannot be pooled: remove one of "
                "these runs and make it again with --resume"
            )


def identity_notes(metrics: Iterable[str]) -> list[str]:
    """Where the metrics that other distributions compute are from, one note each.

    They are computed when a table is made, so that no run depends on them.
    """
    found = {name: METRICS.identity(name) for name in metrics}
    return [f"{name} is computed by {identity}." for name, identity in found.items() if identity]


def record_note(result: SweepResult) -> tuple[str, ...]:
    """A note on shares of records that another engine simulated than the runs; else ()."""
    others = other_recorders(result.engines)
    return (f"Shares of records compare with machines that {others} simulated.",) if others else ()


@cache
def _full_score(task: str, knobs: str) -> float | None:
    """`full_score` of a task with these knobs (JSON); None if the task cannot be made here."""
    with suppress(UsageError):
        return full_score(get_task(task, json.loads(knobs)))
    return None


def layout_table(result: SweepResult, *, published: bool = False) -> Table:
    """The table in the published layout, with published rows if `published`."""
    columns = _columns(result)
    measured = tuple(
        Row(key, tuple(_value(result, runs, column) for column in columns))
        for key, runs in _rows(result).items()
    )
    published_rows = _published_rows(result, columns) if published else ()
    by_task = result.sweep.table.columns == "task"
    sources = [literature.SOURCES.get(source.table) for source in result.sweep.table.published]
    used = dict.fromkeys(column.metric for column in columns)
    about = "; ".join(f"{name}: {METRICS[name].about}" for name in used)
    return Table(
        result.sweep.title,
        ("model",) if by_task else ("task", "model"),
        tuple(
            Column(c.group, c.metric, m.percent, m.digits)
            for c in columns
            for m in [METRICS[c.metric]]
        ),
        measured,
        published_rows,
        (
            *result.notes,
            f"{about}.",
            *identity_notes(used),
            *(record_note(result) if "share" in used else ()),
            *(filter(None, sources) if published_rows else ()),
        ),
    )


@dataclass(frozen=True)
class _Cell:
    """A column of the published layout."""

    group: str
    task: str
    """Only this task; "" for the task of the row."""
    condition: str
    metric: str


def conditions(result: SweepResult) -> tuple[str, ...]:
    """What the columns of the published layout compare; ("",) for nothing."""
    table = result.sweep.table
    if table.conditions == "stages":
        return STAGES
    if table.conditions == "none":
        return ("",)
    if table.conditions == "rounds":
        return tuple(f"rounds_{count}" for count in table.rounds)
    return tuple(dict.fromkeys(planned.variant for planned in result.planned))


def _columns(result: SweepResult) -> list[_Cell]:
    table, compared = result.sweep.table, conditions(result)
    return [
        _Cell(f"{task} {condition}".strip(), task, condition, metric)
        for task in (result.tasks if table.columns == "task" else ("",))
        for condition in compared
        for metric in table.task_metrics.get(task, table.metrics)
    ]


def _rows(result: SweepResult) -> dict[tuple[str, ...], list[FinishedRun]]:
    """Labels of each row -> its finished runs, if any."""
    table = result.sweep.table
    by_task, by_variant = table.columns == "task", table.conditions != "axes"

    def labels(planned: SweepRun, model: str) -> tuple[str, ...]:
        if by_variant and planned.variant:
            model = f"{model}, {planned.variant}"
        return (model,) if by_task else (task_of(planned), model)

    return group_runs(result, labels)


def group_runs(
    result: SweepResult, labels: Callable[[SweepRun, str], tuple[str, ...]]
) -> dict[tuple[str, ...], list[FinishedRun]]:
    """The finished runs of each row of a table; none in rows whose runs are all unfinished.

    The model of an unfinished run is that of a finished run with the same configured model and
    workflow.

    Args:
        result: The sweep.
        labels: Labels of the row of a run, given the name of its model.
    """
    done = {run.planned.name: run for run in result.finished}
    seen = {labels(run.planned, "") for run in result.finished}
    models = {_model_key(run.planned): run.result.model for run in result.finished}
    rows: dict[tuple[str, ...], list[FinishedRun]] = {}
    for planned in result.planned:
        run = done.get(planned.name)
        if run is not None:
            rows.setdefault(labels(planned, run.result.model), []).append(run)
        elif labels(planned, "") not in seen:
            seen.add(labels(planned, ""))
            model = models.get(_model_key(planned), planned.config.model.name)
            rows.setdefault(labels(planned, model), [])
    return rows


def _model_key(planned: SweepRun) -> tuple[str, str]:
    """Decides the name of the model in results; some workflows use no model."""
    return planned.config.model.name, planned.config.workflow


def _value(result: SweepResult, runs: Iterable[FinishedRun], place: _Cell) -> Value:
    table = result.sweep.table
    runs = [run for run in runs if not place.task or task_of(run.planned) == place.task]
    if table.conditions == "axes":
        runs = [run for run in runs if run.planned.variant == place.condition]
    if not runs:
        return None
    stage = place.condition if table.conditions == "stages" else table.stage
    rounds = int(place.condition.partition("_")[2]) if table.conditions == "rounds" else None
    with METRICS.blaming(place.metric):
        return METRICS[place.metric].of(Cell(tuple(run.numbers for run in runs), stage, rounds))


def _published_rows(result: SweepResult, columns: Sequence[_Cell]) -> tuple[Row, ...]:
    by_task, tasks = result.sweep.table.columns == "task", {*result.tasks}
    found: dict[tuple[str, str], dict[tuple[str, str, str], str]] = {}
    for source in result.sweep.table.published:
        for item in literature.published():
            named = source.conditions or {item.condition: item.condition}
            if item.table == source.table and item.condition in named and item.tasks & tasks:
                key = ("" if by_task else item.task, item.model)
                place = (item.task, named[item.condition], item.metric)
                found.setdefault(key, {})[place] = item.value
    rows = []
    for (task, model), values in found.items():
        cells = tuple(_published_value(values, column, task) for column in columns)
        if any(cell is not None for cell in cells):
            rows.append(Row((model,) if by_task else (task, model), cells))
    return tuple(rows)


def _published_value(
    values: Mapping[tuple[str, str, str], str], place: _Cell, task: str
) -> str | None:
    """The published number of a cell; if tasks are columns, for any condition."""
    if not place.task:
        return values.get((task, place.condition, place.metric))
    fitting = (v for (t, _, m), v in values.items() if (t, m) == (place.task, place.metric))
    return next(fitting, None)
