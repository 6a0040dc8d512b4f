"""Runs and sweeps on disk, as objects and data frames: finished ones, and those that still grow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from agentflow.app.design.execution import best_machine
from agentflow.app.sweeps.folder import RUNS, read_failures, read_folder
from agentflow.app.sweeps.registry import LAYOUT
from agentflow.app.sweeps.views import view
from agentflow.config.run import DesignConfig, build_config
from agentflow.config.sweep import SweepConfig, list_runs
from agentflow.errors import RunError, UsageError
from agentflow.extras import needs_extra
from agentflow.machine import Machine
from agentflow.metrics.cells import mean_known
from agentflow.metrics.intervals import bootstrap_mean
from agentflow.metrics.machines import recorded_machine
from agentflow.metrics.tables import FORMATS
from agentflow.notebook.machine_rows import COLUMNS, CurvePoint, curve, machine_rows
from agentflow.notebook.words import By, require_word
from agentflow.runs import Event, RunResult, State, read_calls, read_document, state_of
from agentflow.runs import read_result as read_run_result
from agentflow.runs.events import RunEvent, read_typed_events
from agentflow.runs.reading import RESULT, require_runs
from agentflow.runs.record import RunRecord

if TYPE_CHECKING:
    import pandas

Row = Mapping[str, Any]


def frame(rows: Iterable[Row], columns: Iterable[str] = ()) -> pandas.DataFrame:
    """A data frame of rows; without any, it has these columns.

    Raises:
        ConfigError: pandas is not installed.
    """
    with needs_extra("notebook"):
        import pandas
    items = list(rows)
    names = dict.fromkeys([*columns, *(name for row in items for name in row)])
    found = pandas.DataFrame(items, columns=list(names))
    unknown = found.columns[found.isna().all()]
    return found.astype(dict.fromkeys(unknown, "float64"))  # not a number, rather than None


@dataclass(frozen=True, repr=False)
class Run:
    """A run as it was when it was first read. Load it again to see how it has grown."""

    path: Path
    """The run directory."""
    labels: Mapping[str, str] = field(default_factory=dict, compare=False)
    """Axis of its sweep -> label; empty outside of sweeps."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))
        read_document(self.path)  # says what is wrong with other folders

    def __repr__(self) -> str:
        try:
            state: str = self.state
        except UsageError:
            state = "removed"
        return f"Run({str(self.path)!r}, {state})"

    @property
    def state(self) -> State:
        """`done`, `running` in some process, or `stopped` before its end."""
        return state_of(self.path)

    @cached_property
    def config(self) -> DesignConfig:
        """The complete configuration."""
        return build_config(read_document(self.path).get("config"))

    @cached_property
    def events(self) -> tuple[RunEvent | Event, ...]:
        """Everything that happened, typed; kinds of plug-ins that are not installed are `Event`s.

        Raises:
            RunError: A line is damaged.
        """
        return tuple(read_typed_events(self.path))

    @cached_property
    def record(self) -> RunRecord:
        """The totals of the events."""
        return RunRecord.of(self.events)

    @cached_property
    def calls(self) -> tuple[Mapping[str, Any], ...]:
        """The calls of models: `key`, `model`, `request` and `reply` of each.

        Raises:
            RunError: A line is damaged.
        """
        return tuple(read_calls(self.path))

    @cached_property
    def machines(self) -> Mapping[str, Machine]:
        """Content hash -> machine, of every machine that was simulated, in order.

        Raises:
            RunError: A file of a machine is damaged.
        """
        return {digest: recorded_machine(self.path, digest) for digest in self.record.machines}

    @property
    def scores(self) -> Mapping[str, float | None]:
        """Content hash -> score; None for an invalid machine, and after a crash."""
        found = self.record.machines.items()
        return {digest: event.score if event.valid else None for digest, event in found}

    @property
    def result(self) -> RunResult:
        """The content of result.json.

        Raises:
            RunError: The run is unfinished, or the file is damaged.
        """
        return read_run_result(self.path)

    @property
    def machine(self) -> Machine | None:
        """The best machine of a finished run; None if no machine was valid."""
        return best_machine(self.result)

    def rows(self) -> list[dict[str, Any]]:
        """The content of `to_frame`, which needs no pandas: one row per machine."""
        return machine_rows(self.events, self.path.name, self.config.seed)

    def to_frame(self) -> pandas.DataFrame:
        """One row per machine: run, seed, stage, trajectory, round, node, parent, machine (content
        hash), score, verified, validity (`valid`, `invalid`, or `refused`), problem, and what the
        run had spent by then: simulations, calls, tokens, seconds.

        Raises:
            ConfigError: pandas is not installed.
        """
        return frame(self.rows(), COLUMNS)

    def curve(self, by: By = "simulations") -> tuple[CurvePoint, ...]:
        """The best score so far, after each machine, against what the run had spent.

        Args:
            by: `simulations`, `calls`, `tokens`, or `seconds` of work.
        """
        require_word("cost", by, By)
        return curve(self.events, by)


def load_runs(folder: Path | str) -> list[Run]:
    """The runs in a folder and its subfolders, by name. Runs inside runs are not found.

    Raises:
        RunError: There is no such folder, it contains no run, or a run is damaged.
    """
    path = Path(folder)
    if not path.is_dir():
        raise RunError(f"no such directory: {path}")
    return list(map(Run, require_runs(path)))


@dataclass(frozen=True, repr=False)
class Sweep:
    """A sweep as it was when it was first read: its runs by axis and seed, finished or not."""

    path: Path
    """The sweep directory."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))
        read_folder(self.path)  # says what is wrong with other folders

    def __repr__(self) -> str:
        planned = len(list_runs(self.config))
        return f"Sweep({str(self.path)!r}, {len(self.runs)} of {planned} runs done)"

    @cached_property
    def config(self) -> SweepConfig:
        """What varies, and the configuration that all runs share."""
        return read_folder(self.path)[1]

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The finished runs, in the order of the sweep; `labels` of each name its condition."""
        places = ((self.path / RUNS / run.name, run.labels) for run in list_runs(self.config))
        return tuple(Run(path, labels) for path, labels in places if (path / RESULT).exists())

    @property
    def failed(self) -> Mapping[str, str]:
        """Name of each failed run -> reason in one line."""
        return read_failures(self.path)

    @property
    def best(self) -> Run | None:
        """The run with the best machine, by verified score where there is one."""
        scored = [(run.result.trusted_score, run) for run in self.runs]
        known = [(score, run) for score, run in scored if score is not None]
        return max(known, key=lambda pair: pair[0])[1] if known else None

    def rows(self) -> list[dict[str, Any]]:
        """The content of `to_frame`, which needs no pandas: one row per machine of each run."""
        return [{**run.labels, **row} for run in self.runs for row in run.rows()]

    def to_frame(self) -> pandas.DataFrame:
        """One row per machine of each finished run: the label on each axis, then as `Run.to_frame`.

        Raises:
            ConfigError: pandas is not installed.
        """
        return frame(self.rows(), [*self.config.axes, *COLUMNS])

    def summary_rows(self) -> list[dict[str, Any]]:
        """The content of `summary`, which needs no pandas: one row per condition."""
        conditions: dict[tuple[tuple[str, str], ...], list[Run]] = {}
        for run in self.runs:
            conditions.setdefault(tuple(run.labels.items()), []).append(run)
        return [{**dict(labels), **_numbers(runs)} for labels, runs in conditions.items()]

    def summary(self) -> pandas.DataFrame:
        """One row per condition: its number of runs, and of the scores of their best machines the
        mean, its 95 % bootstrap interval over runs (low, high), the best, and the mean of those
        that are verified. In all but the last, a run without a valid machine counts as 0.

        Raises:
            ConfigError: pandas is not installed.
        """
        return frame(self.summary_rows(), self.config.axes)

    def table(self, show: str = LAYOUT, form: str = "text", *, published: bool = False) -> str:
        """A table as `agentflow table` prints it; the arguments are those of its options."""
        return FORMATS[form](view(self.path, show, published=published))


def _numbers(runs: list[Run]) -> dict[str, Any]:
    results = [run.result for run in runs]
    scores = [result.score or 0.0 for result in results]
    interval = bootstrap_mean(scores)
    return {
        "runs": len(runs),
        "mean": fmean(scores),
        "low": interval.low if interval else None,
        "high": interval.high if interval else None,
        "best": max(scores),
        "verified": mean_known(result.verified_score for result in results),
    }
