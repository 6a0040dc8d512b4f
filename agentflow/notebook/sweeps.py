"""Sweeps on disk, as objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from agentflow.app.sweeps.folder import RUNS, read_failures, read_folder
from agentflow.app.sweeps.registry import LAYOUT
from agentflow.app.sweeps.views import format_view
from agentflow.config.sweep import SweepConfig, list_runs
from agentflow.metrics.intervals import bootstrap_mean
from agentflow.metrics.scores import mean_known
from agentflow.notebook.frames import frame
from agentflow.notebook.machine_rows import COLUMNS
from agentflow.notebook.recorded import Run
from agentflow.runs.reading import RESULT

if TYPE_CHECKING:
    import pandas


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
        return format_view(self.path, show, form, published=published)


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
