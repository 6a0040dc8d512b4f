"""Owns the reward of a reply, for training: (task, text, seed) -> validity and score (spec 6.6).

What is valid is the machine language's, what it is worth the task's; nothing is weighed here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from agentflow.env.pool.pool import RolloutPool
from agentflow.env.rollout import Rollout
from agentflow.env.simulation.refusals import invalid
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, Problem, Report, check, read_machine


@dataclass(frozen=True)
class Reward:
    """What a reply is worth, and the parts of which a trainer may make a reward of its own."""

    value: float | None
    """The score, 0 for a reply without a valid machine. None when the computer failed (time limit,
    crash): such a sample says nothing of the reply and is to be dropped."""
    parsed: bool
    """Whether the reply holds a file-valid machine."""
    spatial: bool | None
    """Whether that machine keeps to space: no overlaps, not too large; None without one."""
    valid: bool
    """Whether it is what the task demands in every respect, and was simulated."""
    status: str
    """ok, invalid, diverged, timeout or crashed."""
    problems: tuple[Problem, ...]
    """Why it is not valid."""
    machine: Machine | None = field(repr=False)
    """The machine in the reply."""
    rollout: Rollout = field(repr=False)
    """Terms of the score, breakages, states, feedback."""


def reward(
    task: str | Task, text: str, seed: int = 0, *, knobs: Mapping[str, object] | None = None
) -> Reward:
    """What a model's reply is worth at a task.

    The reply is read as a designer's: any text, whose last JSON list that looks like a machine
    counts. The same reply, task and seed give the same reward.

    Args:
        task: Level, for instance "throwing", or a task that was looked up before.
        text: The reply.
        seed: Of a task's random trials.
        knobs: Knobs of the level that differ; with a level's name only.

    Raises:
        UsageError: There is no such task or knob.
    """
    level, report = _judged(task, text, knobs)
    if report.machine is None:
        return _reward(report, invalid(report.problems))
    return _reward(report, simulate(report.machine, level, seed=seed))


async def reward_async(
    task: str | Task,
    text: str,
    pool: RolloutPool,
    seed: int = 0,
    *,
    knobs: Mapping[str, object] | None = None,
) -> Reward:
    """`reward` in a worker process of a pool, several at a time.

    Raises:
        UsageError: There is no such task or knob.
    """
    level, report = _judged(task, text, knobs)
    if report.machine is None:
        return _reward(report, invalid(report.problems))
    return _reward(report, await pool.run(report.machine, level, seed=seed))


def _judged(task: str | Task, text: str, knobs: Mapping[str, object] | None) -> tuple[Task, Report]:
    level = get_task(task, knobs) if isinstance(task, str) else task
    brief = level.brief
    return level, check(read_machine(text, brief.blocks, brief.given), brief)


def _reward(report: Report, rollout: Rollout) -> Reward:
    return Reward(
        value=rollout.score,
        parsed=report.file_valid,
        spatial=report.spatial_valid,
        valid=rollout.status != "invalid",
        status=rollout.status,
        problems=report.problems,
        machine=report.machine,
        rollout=rollout,
    )
