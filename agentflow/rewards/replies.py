"""The reward of a model's reply: (task, reply text, seed) -> validity and score."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from agentflow.env.physics.engine import AUTO
from agentflow.env.pool.base import Pool
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine import Machine, Problem, Report, check, read_machine


@dataclass(frozen=True)
class Reward:
    """The reward of a reply, and its parts for trainers that use another formula."""

    value: float | None
    """The score; 0 without a valid machine. None after a time-out or crash: drop the sample,
    because it says nothing about the reply."""
    parsed: bool
    """Whether the reply contains a file-valid machine."""
    spatial: bool | None
    """Whether the machine has no overlaps and fits the size limit; None without a machine."""
    valid: bool
    """Whether the machine meets every rule of the task and was simulated."""
    status: str
    """ok, invalid, diverged, timeout or crashed."""
    problems: tuple[Problem, ...]
    """Why it is not valid."""
    machine: Machine | None = field(repr=False)
    """The machine in the reply, if any."""
    rollout: Rollout = field(repr=False)
    """Terms of the score, breakages, states, feedback."""


def reward(
    task: str | Task,
    text: str,
    seed: int = 0,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = AUTO,
) -> Reward:
    """Compute the reward of a model's reply to a task.

    The reply may be any text; the last JSON list that looks like a machine counts. The same reply,
    task and seed give the same reward.

    Args:
        task: Name of a level, e.g. "throwing", or a task object.
        text: The reply.
        seed: Random seed of the task's trials.
        knobs: Knobs of the level to change; only with a level name.
        engine: Physics engine; only with a level name, since a task object has one.

    Raises:
        UsageError: The task, knob or engine does not exist.
    """
    level, report = _check_reply(task, text, knobs, engine)
    if report.machine is None:
        return _reward(report, invalid_rollout(report.problems))
    return _reward(report, simulate(report.machine, level, seed=seed))


async def reward_async(
    task: str | Task,
    text: str,
    pool: Pool,
    seed: int = 0,
    *,
    knobs: Mapping[str, object] | None = None,
    engine: str = AUTO,
) -> Reward:
    """Like `reward`, in a worker process of a pool, for concurrent use."""
    level, report = _check_reply(task, text, knobs, engine)
    if report.machine is None:
        return _reward(report, invalid_rollout(report.problems))
    return _reward(report, await pool.run(report.machine, level, seed=seed))


def _check_reply(
    task: str | Task, text: str, knobs: Mapping[str, object] | None, engine: str
) -> tuple[Task, Report]:
    level = get_task(task, knobs, engine) if isinstance(task, str) else task
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
