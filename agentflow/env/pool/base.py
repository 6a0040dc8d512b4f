"""What pools that run rollouts have in common, wherever their workers are."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from agentflow.env.pool.worker import Reply
from agentflow.env.rollout import Feedback, Rollout, Status
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.machine.tree import Machine
from agentflow.progress import TALLY

GRACE = 30.0
"""Seconds of computing beyond a rollout's limit after which its worker counts as hung."""
ATTEMPTS = 3
"""Workers that a rollout may crash before it is recorded as crashed."""
AHEAD = 16
"""Rollouts to begin for each worker, so that a slow one does not keep the others waiting, and so
that a message to a worker on another machine can hold several."""

_P = TypeVar("_P", bound="Pool")


class Simulator(Protocol):
    """Runs rollouts: a pool of worker processes, or a store in front of one."""

    async def run(
        self,
        machine: Machine,
        task: Task,
        *,
        seed: int = 0,
        variation: Variation = DEFAULT,
        interval: float | None = None,
    ) -> Rollout:
        """The rollout of a machine at a task, under the default conditions or a variation.

        `interval` is the time between samples, s; None for the usual one.
        """


class Pool(ABC):
    """Runs rollouts in `workers` processes; results do not depend on which worker ran them.

    Use as an async context manager; leaving it ends every worker, even during a rollout.
    """

    def __init__(self, workers: int) -> None:
        if workers < 1:
            raise ValueError(f"a pool needs at least one worker, not {workers}")
        self.workers = workers

    async def __aenter__(self: _P) -> _P:
        await self._start()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._stop()

    async def run(
        self,
        machine: Machine,
        task: Task,
        *,
        seed: int = 0,
        variation: Variation = DEFAULT,
        rate: float | None = None,
        power: bool = True,
        interval: float | None = None,
        cpu_limit: float = 60.0,
        recorded: bool = False,
    ) -> Rollout:
        """Run `simulate` in the next free workers, one trial in each; same arguments.

        Returns:
            What `simulate` would return; status `crashed` if a trial crashed `ATTEMPTS` workers,
            `timeout` if its worker hung.

        Raises:
            UsageError: As `simulate` does.
            RuntimeError: `simulate` raised another error, which is a bug; includes the traceback.
        """
        options = {
            "rate": rate,
            "power": power,
            "interval": interval,
            "cpu_limit": cpu_limit,
            "recorded": recorded,
        }
        trials = task.trials(seed)
        jobs = (
            {"machine": machine, "task": trial, "seed": seed, "variation": variation, **options}
            for trial in trials
        )
        with TALLY.get().count(len(trials)) as end_one:

            async def run_one(job: dict[str, Any]) -> Rollout:
                rollout = await self._run_trial(job)
                end_one()
                return rollout

            return combine_trials(await asyncio.gather(*map(run_one, jobs)), trials)

    @abstractmethod
    async def _start(self) -> None:
        """Start the workers."""

    @abstractmethod
    async def _stop(self) -> None:
        """End the workers."""

    @abstractmethod
    async def _run_trial(self, job: dict[str, Any]) -> Rollout:
        """Call `simulate` with these arguments in a worker, and again if that worker died."""


OpenPool = Callable[[int], Pool]
"""Makes a pool with so many workers, such as the class of one."""


def rollout_in(reply: Reply) -> Rollout:
    """The rollout that a worker sent, or raise the error that it sent."""
    if isinstance(reply, UsageError):
        raise reply
    if isinstance(reply, str):
        raise RuntimeError(f"a rollout failed in its worker:\n{reply}")
    return reply


def crashed_rollout() -> Rollout:
    """The rollout of a trial that crashed too many workers."""
    return _without_score("crashed", f"its process died {ATTEMPTS} times")


def hung_rollout(timeout: float) -> Rollout:
    """The rollout of a trial whose worker has not answered within so many seconds."""
    return _without_score("timeout", f"no answer within {timeout:g} s")


def _without_score(status: Status, why: str) -> Rollout:
    """A rollout that failed because of the computer, not the machine."""
    return Rollout(status, None, Feedback(f"No score: the simulation was cut off, {why}.", {}))
