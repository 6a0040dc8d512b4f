"""Subjects: what is simulated, on which task, with which seed, and where it came from.

Each command that simulates machines resolves what the user named into one of these first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from agentflow.app.design.plan import require_engine_of_run, task_of_run
from agentflow.app.design.results import best_machine
from agentflow.app.machines.files import read_source
from agentflow.app.tasks import find_task
from agentflow.config.run import build_config
from agentflow.env.pool.base import Pool
from agentflow.env.rollout import Rollout
from agentflow.env.tasks.base import Task
from agentflow.errors import RunError, UsageError
from agentflow.machine import Machine, Problem, check
from agentflow.machine.formats.detect import read_for
from agentflow.machine.formats.parse import Reading
from agentflow.machine.validity import problems_of
from agentflow.runs import RunResult, read_document, read_result


@dataclass(frozen=True)
class Origin:
    """A finished run whose best machine is meant, at its own task and with its seed."""

    path: Path
    document: Mapping[str, Any]
    """The content of its run.yaml."""
    result: RunResult


@dataclass(frozen=True)
class Subject:
    """A machine to simulate on a task."""

    machine: Machine | None
    """None if it cannot be built."""
    task: Task
    seed: int = 0
    origin: Origin | str = ""
    """Its run, or else the name of its file or record."""
    faults: tuple[Problem, ...] = ()
    """Why there is no machine."""
    recorded: bool = False
    """Whether it is from a record, which rules that came later do not make invalid."""

    @classmethod
    def read(cls, reading: Reading, task: Task, seed: int, origin: str = "") -> Subject:
        """The machine of a reading made under the rules of the task."""
        report = check(reading, task.brief)
        faults = report.problems if report.machine is None else ()
        return cls(report.machine, task, seed, origin, faults)

    @classmethod
    def of_text(cls, source: object, task: Task, seed: int) -> Subject:
        """A machine given as text or data."""
        return cls.read(read_for(task.brief, source), task, seed)

    @classmethod
    def of_run(cls, path: Path) -> Subject:
        """The best machine of a finished run.

        Raises:
            RunError: The run is unfinished or damaged, or has no valid machine.
        """
        origin = Origin(path, read_document(path), read_result(path))
        machine = best_machine(origin.result)
        if machine is None:
            raise RunError(f"{path} has no valid machine; {origin.result.reason}")
        seed = build_config(origin.document.get("config")).seed
        return cls(machine, task_of_run(path, origin.document), seed, origin, recorded=True)

    @property
    def run(self) -> Origin | None:
        """The run that it is the best machine of, if it is meant with the run's own task."""
        return self.origin if isinstance(self.origin, Origin) else None

    @cached_property
    def problems(self) -> tuple[Problem, ...]:
        """Why it is not valid for the task by today's rules."""
        return self.faults if self.machine is None else problems_of(self.machine, self.task.brief)

    def require_engine(self) -> None:
        """Raise ConfigError if it is from a run whose engine is not installed."""
        if self.run is not None:
            require_engine_of_run(self.run.path, self.run.document)

    def on(self, engine: str) -> Subject:
        """The same, on the engine of this name."""
        return replace(self, task=replace(self.task, engine=engine))

    async def simulate(self, pool: Pool, task: Task | None = None, **options: Any) -> Rollout:
        """Its rollout, on its own task by default; `options` are further ones of the pool's."""
        assert self.machine is not None
        return await pool.run(
            self.machine, task or self.task, seed=self.seed, recorded=self.recorded, **options
        )


def resolve(
    source: str,
    task: str | None,
    knobs: Iterable[str] | None = None,
    seed: int = 0,
    engine: str | None = None,
) -> Subject:
    """What the user named.

    Args:
        source: Machine file, run directory (its best machine), or `-` for standard input.
        task: Name of the task; None means a run with its own task, knobs, seed and engine.
        knobs: Settings of the task, `knob=value`.
        seed: Random seed.
        engine: Name of the physics engine; the default one if None.

    Raises:
        UsageError: A name or value is wrong, the file holds no machine, or a file has no task.
        RunError: The directory is not a finished run with a valid machine.
    """
    if task is not None:
        level = find_task(task, knobs or (), engine)
        return Subject.read(read_source(source, level.brief), level, seed, source)
    if not Path(source).is_dir():
        raise UsageError("a machine file does not name its task; add --task")
    if knobs or seed or engine:
        raise UsageError(
            "a run has its own task, knobs, seed and engine; remove --set, --seed and --engine, or "
            "name a task with --task"
        )
    return Subject.of_run(Path(source))
