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
from agentflow.env.pool.pool import RolloutPool
from agentflow.env.query import answer_queries
from agentflow.env.rollout import invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.files import write_output
from agentflow.machine import check
from agentflow.machine.formats.detect import read_for


def simulate_text(
    text: object,
    task: Task,
    *,
    seed: int,
    rate: float | None,
    power: bool,
    queries: Sequence[str] = (),
    save: Path | None = None,
) -> dict[str, Any]:
    """Simulate one machine given as text or data; the result as data.

    States are saved only if the machine was simulated.
    """
    parsed = [_parse_query(item) for item in queries]
    report = check(read_for(task.brief, text), task.brief)
    budget = task.brief.budget_json(report.machine)
    if report.machine is None:
        return rollout_json(invalid_rollout(report.problems)) | budget
    rollout = simulate(report.machine, task, seed=seed, power=power, rate=rate)
    result = rollout_json(rollout) | budget
    if parsed:
        result["answers"] = answer_queries(report.machine, rollout, parsed).data
    if save is not None and rollout.trace is not None:
        with write_output(save) as part:
            save_npz(rollout, part)
    return result


async def simulate_lines(
    lines: Iterable[str],
    task: Task,
    *,
    seed: int,
    rate: float | None,
    power: bool,
    workers: int,
) -> AsyncIterator[dict[str, Any]]:
    """Simulate one machine per line, as lines arrive; one result per line, in order.

    At most a few rollouts per worker are in memory at a time.
    """

    async def result(line: str) -> dict[str, Any]:
        report = check(read_for(task.brief, parse_line(line)), task.brief)
        budget = task.brief.budget_json(report.machine)
        if report.machine is None:
            return rollout_json(invalid_rollout(report.problems)) | budget
        rollout = await pool.run(report.machine, task, seed=seed, power=power, rate=rate)
        return rollout_json(rollout) | budget

    ahead: asyncio.Queue[asyncio.Task[dict[str, Any]] | Exception | None] = asyncio.Queue(
        2 * workers
    )

    async def begin(line: str | Exception | None) -> None:
        await ahead.put(asyncio.create_task(result(line)) if isinstance(line, str) else line)

    async with RolloutPool(workers) as pool:
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


def _parse_query(text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise UsageError(
            f"--query takes JSON such as "
            f'{{"id": 3, "duration": [0, 1], "properties": ["position"]}}, not {text[:60]!r}'
        ) from None
