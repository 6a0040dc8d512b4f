"""A worker process: answers jobs with rollouts until the other end closes.

It keeps its engine between rollouts, and ends by itself when its parent ends. It does not import
pool.py, which would cost every worker start-up time.
"""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection

from agentflow.env.rollout import Rollout
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.machine.tree import Machine


@dataclass(frozen=True)
class Job:
    """One trial to run; pickled to the worker."""

    machine: Machine
    task: Task
    seed: int
    rate: float | None
    power: bool
    interval: float | None
    wall_limit: float


def serve(descriptor: int) -> None:
    """Answer jobs until the other end closes."""
    with Connection(descriptor) as connection:
        while True:
            try:
                job = connection.recv()
            except (EOFError, ConnectionResetError):  # closed, or killed with a reply unread
                return
            try:
                reply: Rollout | UsageError | str = simulate(
                    job.machine,
                    job.task,
                    seed=job.seed,
                    rate=job.rate,
                    power=job.power,
                    interval=job.interval,
                    wall_limit=job.wall_limit,
                )
            except UsageError as error:
                reply = error
            except Exception:  # noqa: BLE001 - the parent raises it
                reply = traceback.format_exc()
            try:
                connection.send(reply)
            except (BrokenPipeError, ConnectionResetError):  # the parent has been killed
                return
