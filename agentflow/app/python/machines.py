"""Owns single machines for Python programs (spec 6.6): `agentflow check` and `simulate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from agentflow.app.machines.files import machine_text
from agentflow.errors import UsageError
from agentflow.machine import Machine, Report
from agentflow.machine import check as judge
from agentflow.machine.brief import Brief
from agentflow.machine.formats.detect import read_for

if TYPE_CHECKING:  # checking a machine needs no physics
    from agentflow.env.pool.pool import RolloutPool
    from agentflow.env.rollout import Rollout

MachineLike = Machine | str | list[dict[str, Any]] | Path
"""A machine: itself, any text that holds one (also .bsg), JSON data, or the path of a file."""


def check(
    machine: MachineLike, task: str | None = None, *, knobs: Mapping[str, object] | None = None
) -> Report:
    """Judge a machine: file, space, and what a task demands. Needs no physics.

    Args:
        machine: What to judge.
        task: The level whose demands count; none by default.
        knobs: Knobs of the level that differ, for instance `{"wall.height": 0}`.

    Raises:
        UsageError: There is no such task, knob or file.
    """
    if knobs and task is None:
        raise UsageError("knobs change a task; name it with task=")
    if task is None:
        return _judged(machine, None)
    from agentflow.env.tasks.registry import get_task

    return _judged(machine, get_task(task, knobs).brief)


def simulate(
    machine: MachineLike,
    task: str,
    *,
    knobs: Mapping[str, object] | None = None,
    seed: int = 0,
    rate: float | None = None,
    power: bool = True,
) -> Rollout:
    """Build a machine, let physics run, and score it.

    Args:
        machine: What to try; an invalid one gives a rollout of status `invalid` and score 0.
        task: The level to play, for instance "throwing" or "movement/3".
        knobs: Knobs of the level that differ.
        seed: Of everything left to chance.
        rate: Steps per second; the constants' by default.
        power: False is the control experiment: nothing is ever switched on.

    Raises:
        UsageError: There is no such task, knob or file, or the rate is out of range.
    """
    from agentflow.env.simulation.refusals import invalid
    from agentflow.env.simulation.simulate import simulate as roll_out
    from agentflow.env.tasks.registry import get_task

    level = get_task(task, knobs)
    report = _judged(machine, level.brief)
    if report.machine is None:
        return invalid(report.problems)
    return roll_out(report.machine, level, seed=seed, rate=rate, power=power)


async def simulate_async(
    machine: MachineLike,
    task: str,
    pool: RolloutPool,
    *,
    knobs: Mapping[str, object] | None = None,
    seed: int = 0,
    rate: float | None = None,
    power: bool = True,
) -> Rollout:
    """`simulate` in a worker process of a pool, several at a time.

    Raises:
        UsageError: As `simulate`.
    """
    from agentflow.env.simulation.refusals import invalid
    from agentflow.env.tasks.registry import get_task

    level = get_task(task, knobs)
    report = _judged(machine, level.brief)
    if report.machine is None:
        return invalid(report.problems)
    return await pool.run(report.machine, level, seed=seed, rate=rate, power=power)


def _judged(machine: MachineLike, brief: Brief | None) -> Report:
    if isinstance(machine, Machine):
        return judge(machine, brief)
    source = machine_text(str(machine)) if isinstance(machine, Path) else machine
    report = judge(read_for(brief, source), brief)
    if report.machine is None and isinstance(source, str) and _names_file(source):
        first, *others = report.problems
        message = f"{first.message}; it names a file, which is given as Path({source!r})"
        report = replace(report, problems=(replace(first, message=message), *others))
    return report


def _names_file(text: str) -> bool:
    try:
        return Path(text).is_file()
    except (OSError, ValueError):  # too long for a name, or with a null character
        return False
