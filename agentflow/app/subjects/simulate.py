"""Simulates machines: one or many, with queries and saved states."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Sequence
from pathlib import Path
from typing import Any

from agentflow.app.machines.files import parse_line
from agentflow.app.subjects.subject import Subject
from agentflow.env.archive import rollout_json, save_npz
from agentflow.env.pool.base import AHEAD, OpenPool
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.query import answer_queries
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.guard import is_ours
from agentflow.errors import UsageError
from agentflow.files.atomic import write_output
from agentflow.progress import Progress, counter

WORKERS = 2
"""Worker processes by default."""


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
