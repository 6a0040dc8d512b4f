"""Owns the table of a sweep in the published layout: which runs a cell is made of.

Other views of a sweep are views.py's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from agentflow.app.design.results import read_finished
from agentflow.app.sweeps.folder import RUNS, failures, read_folder
from agentflow.config.run import DesignConfig
from agentflow.config.sweep import Member, SweepConfig, members
from agentflow.errors import RunError
from agentflow.metrics import published as literature
from agentflow.metrics.cells import METRICS, Cell, RunNumbers, Value
from agentflow.metrics.tables import Column, Row, Table
from agentflow.runs.events import read_typed_events
from agentflow.runs.places import STAGES
from agentflow.runs.record import RunRecord
from agentflow.workflows.registry import WORKFLOWS


@dataclass(frozen=True)
class Finished:
    """One finished run of a sweep."""

    member: Member
    path: Path
    model: str
    """Who answered, as its result says."""
    numbers: RunNumbers


@dataclass(frozen=True)
class Swept:
    """A sweep as far as it is done."""

    path: Path
    sweep: SweepConfig
    runs: tuple[Finished, ...]
    members: tuple[Member, ...]
    """All runs of the sweep, done or not, in its order."""
    failed: Mapping[str, str]

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the runs that are not done."""
        done = {run.member.name for run in self.runs}
        return tuple(member.name for member in self.members if member.name not in done)

    @property
    def tasks(self) -> tuple[str, ...]:
        """In the order of the runs, done or not."""
        return tuple(dict.fromkeys(task_of(member) for member in self.members))

    @property
    def notes(self) -> tuple[str, ...]:
        """What has to be said under every table."""
        seeds = len(self.sweep.seeds)
        pooled = f"{seeds} seeds, pooled" if seeds > 1 else "1 seed"
        told = [f"{len(self.runs)} run{'s' if len(self.runs) != 1 else ''}; {pooled}."]
        if self.missing:
            total = len(self.runs) + len(self.missing)
            failed = sum(name in self.failed for name in self.missing)
            told.append(
                f"INCOMPLETE: {len(self.missing)} of {total} runs are missing, "
                f"{failed} of them failed."
            )
        return tuple(told)


def task_of(member: Member) -> str:
    """The task as rows and columns name it: the axis' label, else the configuration's."""
    return member.labels.get("task", member.config.task)


def read_swept(path: Path) -> Swept:
    """Read what is done of a sweep.

    Raises:
        RunError: There is no sweep, it or a run of it is damaged, or nothing of it is done.
    """
    _, sweep = read_folder(path)
    done: list[Finished] = []
    every = members(sweep)
    for member in every:
        run = path / RUNS / member.name
        if (run / "result.json").exists():
            record = RunRecord.of(read_typed_events(run))
            numbers = RunNumbers(record, _width(member.config))
            done.append(Finished(member, run, read_finished(run)["model"], numbers))
    if not done:
        raise RunError(
            f"no run of {path} is done; carry it out with agentflow sweep {quote(str(path))} "
            "--resume"
        )
    return Swept(path, sweep, tuple(done), every, failures(path))


def _width(config: DesignConfig) -> int:
    return WORKFLOWS[config.workflow].adapt(config.settings).search.children


def layout(swept: Swept, *, published: bool = False) -> Table:
    """The table in the published layout.

    Args:
        swept: The sweep.
        published: Whether published rows stand under the measured ones.
    """
    rows = _rows(swept)
    conditions = _conditions(swept)
    columns = _columns(swept, conditions)
    measured = tuple(
        Row(key, tuple(_value(swept, runs, column) for column in columns))
        for key, runs in rows.items()
    )
    told = _published_rows(swept, columns) if published else ()
    by_task = swept.sweep.table.columns == "task"
    used = dict.fromkeys(column.metric for column in columns)
    about = "; ".join(f"{name}: {METRICS[name].about}" for name in used)
    return Table(
        swept.sweep.title,
        ("model",) if by_task else ("task", "model"),
        tuple(Column(c.group, c.metric, METRICS[c.metric].percent) for c in columns),
        measured,
        told,
        (*swept.notes, f"{about}."),
    )


@dataclass(frozen=True)
class _Place:
    """A column of the published layout."""

    group: str
    task: str
    """None but this task; "" for the row's."""
    condition: str
    metric: str


def _conditions(swept: Swept) -> tuple[str, ...]:
    table = swept.sweep.table
    if table.conditions == "stages":
        return STAGES
    if table.conditions == "none":
        return ("",)
    if table.conditions == "rounds":
        return tuple(f"rounds_{count}" for count in table.rounds)
    return tuple(dict.fromkeys(member.variant for member in swept.members))


def _columns(swept: Swept, conditions: Sequence[str]) -> list[_Place]:
    table = swept.sweep.table
    if table.columns == "task":
        groups = [
            (f"{task} {condition}".strip(), task, condition)
            for task in swept.tasks
            for condition in conditions
        ]
    else:
        groups = [(condition, "", condition) for condition in conditions]
    return [
        _Place(group, task, condition, metric)
        for group, task, condition in groups
        for metric in table.task_metrics.get(task, table.metrics)
    ]


def _rows(swept: Swept) -> dict[tuple[str, ...], list[Finished]]:
    """Labels of a row -> its runs; also of rows of which nothing is done."""
    table = swept.sweep.table
    by_task, by_variant = table.columns == "task", table.conditions != "axes"

    def line(member: Member) -> tuple[str, str]:
        return "" if by_task else task_of(member), member.variant if by_variant else ""

    rows: dict[tuple[str, ...], list[Finished]] = {}
    for member, model, runs in listed(swept, line):
        if by_variant and member.variant:
            model = f"{model}, {member.variant}"
        key = (model,) if by_task else (task_of(member), model)
        rows.setdefault(key, []).extend(runs)
    return rows


def listed(
    swept: Swept, line: Callable[[Member], tuple[str, ...]]
) -> Iterator[tuple[Member, str, list[Finished]]]:
    """What rows are made of: each done run, and one undone of each line of which nothing is done.

    With each goes the model's name: who answered; of an undone one, who answered where the same
    was asked.

    Args:
        swept: The sweep.
        line: What tells the rows of a table apart, but for the model.
    """
    done = {run.member.name: run for run in swept.runs}
    told = {line(run.member) for run in swept.runs}
    models = {_asked(run.member): run.model for run in swept.runs}
    for member in swept.members:
        run = done.get(member.name)
        if run is not None:
            yield member, run.model, [run]
        elif line(member) not in told:
            told.add(line(member))
            yield member, models.get(_asked(member), member.config.model.name), []


def _asked(member: Member) -> tuple[str, str]:
    """What decides who is shown to answer; workflows may ask nobody."""
    return member.config.model.name, member.config.workflow


def _value(swept: Swept, runs: Iterable[Finished], place: _Place) -> Value:
    table = swept.sweep.table
    own = [run for run in runs if not place.task or task_of(run.member) == place.task]
    if table.conditions == "axes":
        own = [run for run in own if run.member.variant == place.condition]
    if not own:
        return None
    stage = place.condition if table.conditions == "stages" else table.stage
    rounds = int(place.condition.partition("_")[2]) if table.conditions == "rounds" else None
    return METRICS[place.metric].of(Cell(tuple(run.numbers for run in own), stage, rounds))


def _published_rows(swept: Swept, columns: Sequence[_Place]) -> tuple[Row, ...]:
    by_task = swept.sweep.table.columns == "task"
    found: dict[tuple[str, str], dict[tuple[str, str, str], str]] = {}
    for source in swept.sweep.table.published:
        for item in literature.published():
            if item.table != source.table or item.task not in swept.tasks:
                continue
            if source.conditions and item.condition not in source.conditions:
                continue
            key = ("" if by_task else item.task, item.model)
            condition = source.conditions.get(item.condition, item.condition)
            place = (item.task, condition, item.metric)
            found.setdefault(key, {})[place] = item.value
    rows = []
    for (task, model), values in found.items():
        cells = tuple(_told(values, column, task) for column in columns)
        if any(cell is not None for cell in cells):
            rows.append(Row((model,) if by_task else (task, model), cells))
    return tuple(rows)


def _told(values: Mapping[tuple[str, str, str], str], place: _Place, task: str) -> str | None:
    """The published number of a place; where tasks are columns, whatever its condition."""
    if not place.task:
        return values.get((task, place.condition, place.metric))
    fitting = (v for (t, _, m), v in values.items() if (t, m) == (place.task, place.metric))
    return next(fitting, None)
