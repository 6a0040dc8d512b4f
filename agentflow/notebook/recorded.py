"""Runs on disk, as objects: finished ones, and those that still grow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agentflow.app.design.results import best_machine
from agentflow.config.run import DesignConfig, build_config
from agentflow.errors import RunError, UsageError
from agentflow.machine import Machine
from agentflow.metrics.machines import recorded_machine
from agentflow.notebook.frames import frame
from agentflow.notebook.machine_rows import COLUMNS, CurvePoint, curve, machine_rows
from agentflow.notebook.words import By, require_word
from agentflow.runs import Event, RunResult, State, find_runs, read_calls, read_document, state_of
from agentflow.runs import read_result as read_run_result
from agentflow.runs.events import RunEvent, read_typed_events
from agentflow.runs.record import RunRecord

if TYPE_CHECKING:
    import pandas


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
    found = [Run(run) for run in find_runs(path)]
    if not found:
        raise RunError(f"{path} contains no run")
    return found
