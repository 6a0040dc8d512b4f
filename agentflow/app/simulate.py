"""Owns single rollouts for a user: one machine or many, with queries, and kept states."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from agentflow.app.machines import line_value
from agentflow.env.pool import RolloutPool
from agentflow.env.query import answer
from agentflow.env.rollout import invalid, rollout_json, save_npz, simulate
from agentflow.env.tasks.base import Task
from agentflow.env.trace import Rollout
from agentflow.errors import UsageError
from agentflow.machine import check


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
    """Simulate one machine given as text or data; the result object of spec 2.6.

    Raises:
        UsageError: A query is no JSON, or the states cannot be saved.
    """
    asked = [_query(item) for item in queries]
    report = check(text, task.brief)  # type: ignore[arg-type]
    if report.machine is None:
        return rollout_json(invalid(report.problems))
    rollout = simulate(report.machine, task, seed=seed, power=power, **_rate(rate))
    result = rollout_json(rollout)
    if asked:
        result["answers"] = answer(report.machine, rollout, asked).data
    if save is not None:
        _save(rollout, save)
    return result


def simulate_lines(
    lines: Iterable[str], task: Task, *, seed: int, power: bool, workers: int
) -> Iterator[dict[str, Any]]:
    """Simulate one machine per line; one result per line, in order."""
    sources = [line_value(line) for line in lines]
    yield from asyncio.run(_simulate_all(sources, task, seed, power, workers))


async def _simulate_all(
    sources: Sequence[object], task: Task, seed: int, power: bool, workers: int
) -> list[dict[str, Any]]:
    async def one(pool: RolloutPool, source: object) -> dict[str, Any]:
        report = check(source, task.brief)  # type: ignore[arg-type]
        if report.machine is None:
            return rollout_json(invalid(report.problems))
        return rollout_json(await pool.run(report.machine, task, seed=seed, power=power))

    async with RolloutPool(workers) as pool:
        return list(await asyncio.gather(*(one(pool, source) for source in sources)))


def _rate(rate: float | None) -> dict[str, Any]:
    return {} if rate is None else {"rate": rate}


def _query(text: str) -> object:
    try:
        return json.loads(text)
    except ValueError:
        raise UsageError(
            f"--query takes JSON such as "
            f'{{"id": 3, "duration": [0, 1], "properties": ["position"]}}, not {text!r}'
        ) from None


def _save(rollout: Rollout, path: Path) -> None:
    if rollout.trace is None:
        raise UsageError(f"nothing to save to {path}: the machine was not simulated")
    try:
        save_npz(rollout, path)
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror}") from None
