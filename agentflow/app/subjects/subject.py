"""Simulates subjects: what is simulated, on which task, with which seed, and where it came from.

Each command that simulates machines resolves what the user named into one of these first.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from agentflow.app.design.execution import best_machine
from agentflow.app.design.plan import require_engine_of_run, task_of_run
from agentflow.app.machines.files import parse_line, read_source
from agentflow.app.tasks import find_task
from agentflow.config.run import build_config
from agentflow.env.archive import rollout_json, save_npz
from agentflow.env.pool.pool import AHEAD, OpenPool, Pool, RolloutPool
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.guard import is_ours
from agentflow.errors import RunError, UsageError
from agentflow.files.atomic import write_output
from agentflow.machine import Machine, Problem, check
from agentflow.machine.formats.detect import read_for
from agentflow.machine.formats.parse import Reading
from agentflow.machine.validity import problems_of
from agentflow.progress import Progress, counter
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
    """A machine to simulate on a task.

    `origin` is its run, or else the name of its file or record. `faults` say why there is no
    machine. `recorded` says whether it is from a record, which rules that came later do not make
    invalid.
    """

    machine: Machine | None
    task: Task
    seed: int = 0
    origin: Origin | str = ""
    faults: tuple[Problem, ...] = ()
    recorded: bool = False

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


WORKERS = 2


def simulate_in_parallel(
    subject: Subject, *, workers: int, say: Progress, **options: Any
) -> Rollout:
    """Simulate a machine; same result as `simulate`.

    Several trials run in worker processes, and so does every trial of a family of another
    distribution: where that hangs or crashes, the rollout says so.

    Args:
        subject: A machine that can be built, and its task.
        workers: Worker processes, at most.
        say: Receives the number of finished trials.
        options: Further arguments of `simulate`.
    """
    machine, trials = subject.machine, subject.task.trials(subject.seed)
    assert machine is not None
    if len(trials) == 1 and is_ours(type(subject.task)):
        return simulate(
            machine, subject.task, seed=subject.seed, recorded=subject.recorded, **options
        )
    tick = counter(say, len(trials))

    async def play(trial: Task, pool: RolloutPool) -> Rollout:
        rollout = await subject.simulate(pool, trial, **options)
        tick()
        return rollout

    async def play_all() -> Rollout:
        async with RolloutPool(min(workers, len(trials))) as pool:
            played = await asyncio.gather(*(play(trial, pool) for trial in trials))
            return combine_trials(played, trials)

    return asyncio.run(play_all())


def simulate_one(
    subject: Subject,
    *,
    workers: int,
    say: Progress,
    queries: Sequence[str] = (),
    save: Path | None = None,
    interval: float | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Simulate one machine; the result as data.

    States are saved only if the machine was simulated.

    Args:
        subject: The machine and its task.
        workers: Worker processes; a single trial needs none.
        say: Receives the number of finished trials.
        queries: JSON texts; their answers are in the result.
        save: File for the states.
        interval: Seconds between recorded states.
        options: Further arguments of `simulate`.
    """
    asked = list(map(_parse_query, queries))
    if subject.machine is None:
        return _rollout_data(subject, invalid_rollout(subject.problems))
    rollout = simulate_in_parallel(subject, workers=workers, say=say, interval=interval, **options)
    if save is not None and rollout.trace is not None:
        with write_output(save) as part:
            save_npz(rollout, part)
    return _rollout_data(subject, rollout, asked, interval)


async def simulate_lines(
    lines: Iterable[str],
    task: Task,
    *,
    seed: int,
    workers: int,
    queries: Sequence[str] = (),
    open_pool: OpenPool = RolloutPool,
    interval: float | None = None,
    **options: Any,
) -> AsyncIterator[dict[str, Any]]:
    """Simulate one machine per line, as lines arrive; one result per line, in order.

    At most a few rollouts per worker are in memory at a time.
    """
    asked = list(map(_parse_query, queries))

    async def result(line: str) -> dict[str, Any]:
        subject = Subject.of_text(parse_line(line), task, seed)
        if subject.machine is None:
            return _rollout_data(subject, invalid_rollout(subject.problems))
        rollout = await subject.simulate(pool, interval=interval, **options)
        return _rollout_data(subject, rollout, asked, interval)

    ahead: asyncio.Queue[asyncio.Task[dict[str, Any]] | Exception | None] = asyncio.Queue(
        AHEAD * workers
    )

    async def begin(line: str | Exception | None) -> None:
        await ahead.put(asyncio.create_task(result(line)) if isinstance(line, str) else line)

    loop = asyncio.get_running_loop()

    def hand_over(item: str | Exception | None) -> None:
        asyncio.run_coroutine_threadsafe(begin(item), loop).result()

    def feed() -> None:
        try:
            for line in lines:
                hand_over(line)
        except Exception as problem:  # noqa: BLE001 - passed to the consumer, which raises it
            hand_over(problem)
        else:
            hand_over(None)

    async with open_pool(workers) as pool:
        threading.Thread(target=feed, daemon=True).start()  # reading a line may block
        while (item := await ahead.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield await item


def _rollout_data(
    subject: Subject,
    rollout: Rollout,
    queries: Sequence[object] = (),
    interval: float | None = None,
) -> dict[str, Any]:
    """The result of a rollout, with the answers to the queries if there are any."""
    result = rollout_json(rollout) | subject.task.brief.budget_json(subject.machine)
    if queries and subject.machine is not None:
        result["answers"] = answer_queries(subject.machine, rollout, queries, interval).data
    return result


def _parse_query(text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise UsageError(
            f"--query takes JSON such as "
            f'{{"id": 3, "duration": [0, 1], "properties": ["position"]}}, not {text[:60]!r}'
        ) from None
