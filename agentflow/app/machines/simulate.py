"""Simulates machines from files: one or many, with queries and saved states."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Sequence
from pathlib import Path
from typing import Any

from agentflow.app.machines.files import parse_line
from agentflow.env.archive import rollout_json, save_npz
from agentflow.env.pool.base import AHEAD, OpenPool
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.files import write_output
from agentflow.machine import Machine, check
from agentflow.machine.formats.detect import read_for
from agentflow.machine.validity import Report

WORKERS = 2
"""Worker processes by default."""
Progress = Callable[[int, int], None]
"""Receives the number of finished simulations and the total."""


def simulate_in_parallel(
    machine: Machine, task: Task, *, seed: int, workers: int, say: Progress, **options: Any
) -> Rollout:
    """Simulate a machine, with several trials in worker processes; same result as `simulate`.

    Args:
        machine: File-valid.
        task: The level.
        seed: Random seed.
        workers: Worker processes; a single trial needs none.
        say: Receives progress.
        options: Further arguments of `simulate`.
    """
    trials = task.trials(seed)
    if len(trials) == 1:
        return simulate(machine, task, seed=seed, **options)
    done = iter(range(1, len(trials) + 1))

    async def play(trial: Task, pool: RolloutPool) -> Rollout:
        rollout = await pool.run(machine, trial, seed=seed, **options)
        say(next(done), len(trials))
        return rollout

    async def play_all() -> Rollout:
        async with RolloutPool(min(workers, len(trials))) as pool:
            return combine_trials(await asyncio.gather(*(play(trial, pool) for trial in trials)))

    return asyncio.run(play_all())


def simulate_text(
    text: object,
    task: Task,
    *,
    seed: int,
    rate: float | None,
    power: bool,
    interval: float | None,
    workers: int,
    say: Progress,
    queries: Sequence[str] = (),
    save: Path | None = None,
) -> dict[str, Any]:
    """Simulate one machine given as text or data; the result as data.

    States are saved only if the machine was simulated.
    """
    asked = _parse_queries(queries)
    report = check(read_for(task.brief, text), task.brief)
    if report.machine is None:
        return _invalid(report, task)
    options = {"power": power, "rate": rate, "interval": interval}
    rollout = simulate_in_parallel(
        report.machine, task, seed=seed, workers=workers, say=say, **options
    )
    if save is not None and rollout.trace is not None:
        with write_output(save) as part:
            save_npz(rollout, part)
    return _told(report.machine, rollout, task, asked, interval)


async def simulate_lines(
    lines: Iterable[str],
    task: Task,
    *,
    seed: int,
    rate: float | None,
    power: bool,
    interval: float | None,
    workers: int,
    queries: Sequence[str] = (),
    open_pool: OpenPool = RolloutPool,
) -> AsyncIterator[dict[str, Any]]:
    """Simulate one machine per line, as lines arrive; one result per line, in order.

    At most a few rollouts per worker are in memory at a time.
    """
    asked = _parse_queries(queries)

    async def result(line: str) -> dict[str, Any]:
        report = check(read_for(task.brief, parse_line(line)), task.brief)
        if report.machine is None:
            return _invalid(report, task)
        rollout = await pool.run(
            report.machine, task, seed=seed, power=power, rate=rate, interval=interval
        )
        return _told(report.machine, rollout, task, asked, interval)

    ahead: asyncio.Queue[asyncio.Task[dict[str, Any]] | Exception | None] = asyncio.Queue(
        AHEAD * workers
    )

    async def begin(line: str | Exception | None) -> None:
        await ahead.put(asyncio.create_task(result(line)) if isinstance(line, str) else line)

    async with open_pool(workers) as pool:
        loop = asyncio.get_running_loop()
        threading.Thread(target=_feed, args=(lines, begin, loop), daemon=True).start()
        while (item := await ahead.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield await item


def _feed(
    lines: Iterable[str],
    begin: Callable[[str | Exception | None], Coroutine[Any, Any, None]],
    loop: asyncio.AbstractEventLoop,
) -> None:
    """Read lines, which may block, in a daemon thread."""

    def hand_over(item: str | Exception | None) -> None:
        asyncio.run_coroutine_threadsafe(begin(item), loop).result()

    try:
        for line in lines:
            hand_over(line)
    except Exception as problem:  # noqa: BLE001 - passed to the consumer, which raises it
        hand_over(problem)
    else:
        hand_over(None)


def _invalid(report: Report, task: Task) -> dict[str, Any]:
    """The result of what cannot be simulated."""
    return rollout_json(invalid_rollout(report.problems)) | task.brief.budget_json(report.machine)


def _told(
    machine: Machine,
    rollout: Rollout,
    task: Task,
    queries: Sequence[object],
    interval: float | None,
) -> dict[str, Any]:
    """The result of a rollout, with the answers to the queries if there are any."""
    result = rollout_json(rollout) | task.brief.budget_json(machine)
    if queries:
        result["answers"] = answer_queries(machine, rollout, queries, interval).data
    return result


def _parse_queries(texts: Sequence[str]) -> list[object]:
    return [_parse_query(text) for text in texts]


def _parse_query(text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise UsageError(
            f"--query takes JSON such as "
            f'{{"id": 3, "duration": [0, 1], "properties": ["position"]}}, not {text[:60]!r}'
        ) from None
