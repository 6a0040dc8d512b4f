"""The reward of a model's reply: (task, reply text, seed) -> validity and score; and of many
replies at once.

Worker processes are started on first use and stay until this process ends, however it ends.
"""

import asyncio
import atexit
import json
import os
from collections.abc import Coroutine, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from threading import Lock, Thread
from typing import Any, TypeVar

from agentflow.env.physics.engine import AUTO
from agentflow.env.pool.pool import OpenPool, Pool, RolloutPool
from agentflow.env.rollout import Rollout, invalid_rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError, NoScoreError, UsageError
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


T = TypeVar("T")


@dataclass(frozen=True)
class Sample:
    """A reply to a task."""

    task: str
    """Level, such as "throwing/3"."""
    text: str
    seed: int = 0
    knobs: Mapping[str, object] | None = None
    engine: str = AUTO


class Scorer:
    """Computes rewards in worker processes, with or without an event loop; thread-safe."""

    def __init__(self, workers: int, open_pool: OpenPool = RolloutPool) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name="scorer", daemon=True)
        self._thread.start()
        self.pool = self.wait_for(open_pool(workers).__aenter__())

    def rewards(self, samples: Sequence[Sample]) -> list[Reward]:
        """The reward of each sample, in their order.

        Raises:
            UsageError: A task, knob or engine does not exist.
        """
        return [work.result() for work in [self.submit(sample) for sample in samples]]

    async def reward(self, sample: Sample) -> Reward:
        """The reward of a sample, for callers with an event loop of their own.

        Raises:
            UsageError: A task, knob or engine does not exist.
        """
        return await asyncio.wrap_future(self.submit(sample))

    def submit(self, sample: Sample) -> Future[Reward]:
        """Begin to compute the reward of a sample, for callers with other work meanwhile."""
        return asyncio.run_coroutine_threadsafe(
            reward_async(
                sample.task,
                sample.text,
                self.pool,
                sample.seed,
                knobs=sample.knobs,
                engine=sample.engine,
            ),
            self._loop,
        )

    def close(self) -> None:
        """End the worker processes, and cancel what still waits for them."""
        self.wait_for(self._end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _end(self) -> None:
        await self.pool.__aexit__(None, None, None)
        waiting = asyncio.all_tasks() - {asyncio.current_task()}
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)

    def wait_for(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of work on the event loop of the worker processes."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()


def shared_scorer(workers: int | None = None) -> Scorer:
    """The scorer of this process with so many workers; by default one per processor.

    Where a launcher such as torchrun started several processes on this computer, they share its
    processors.

    Raises:
        UsageError: The number is below 1.
    """
    if workers is not None and workers < 1:
        raise UsageError(f"workers must be at least 1, not {workers}")
    with _LOCK:
        return _scorer(workers or own_processors(), os.getpid())


def own_processors() -> int:
    """Processors for this process: its share of those that it may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    count = len(allowed(0)) if allowed else os.cpu_count() or 1
    return max(1, count // int(os.environ.get("LOCAL_WORLD_SIZE", "1")))


def require_score(reward: Reward, task: str) -> float:
    """The score, for callers to whom only an error can say that there is none.

    Raises:
        NoScoreError: The simulation timed out or crashed.
    """
    if reward.value is None:
        raise NoScoreError(f"{task}: {reward.rollout.feedback.text}")
    return reward.value


def read_knobs(value: object) -> dict[str, object]:
    """Knobs from a column of a data set: a mapping, JSON text of one, or nothing.

    Tables give every row the keys of all rows, so keys without a value are left out.

    Raises:
        ConfigError: It is something else.
    """
    if isinstance(value, str) and value:
        with suppress(ValueError):
            value = json.loads(value)
    if not value:
        return {}
    if not isinstance(value, Mapping):
        raise ConfigError(
            'knobs must be a mapping such as {"wind.speed": 8}, or JSON text of one, '
            f"not {str(value)[:60]!r}"
        )
    return {str(name): item for name, item in value.items() if item is not None}


_LOCK = Lock()


@cache
def _scorer(workers: int, process: int) -> Scorer:
    """One for each process, because forks need their own; it ends with that process."""
    scorer = Scorer(workers)
    atexit.register(lambda: scorer.close() if os.getpid() == process else None)
    return scorer
