"""A pool of worker processes that run rollouts.

Each worker is a fresh interpreter at the other end of a pipe.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Pipe
from types import TracebackType
from typing import Any, Protocol

from agentflow.env.rollout import Feedback, Rollout, Status
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.machine.tree import Machine

GRACE = 30.0
"""Seconds beyond a rollout's wall-time limit after which its worker counts as hung."""
ATTEMPTS = 2
"""Workers that a rollout may crash before it is recorded as crashed."""
_CHILD = """
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
from agentflow.env.pool.worker import serve
serve(int(sys.argv[1]))
"""
"""Ignores interrupts, which a terminal sends to all processes: the parent handles them."""
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""Physics uses no BLAS; BLAS threads would only cost start-up time and memory."""


class Simulator(Protocol):
    """Runs rollouts: a pool of worker processes, or a store in front of one."""

    async def run(
        self, machine: Machine, task: Task, *, seed: int = 0, variation: Variation = DEFAULT
    ) -> Rollout:
        """The rollout of a machine at a task, under the default conditions or a variation."""


class RolloutPool:
    """Runs rollouts in `workers` processes; results do not depend on which worker ran them.

    Use as an async context manager; leaving it ends every worker, even during a rollout.
    """

    def __init__(self, workers: int, grace: float = GRACE) -> None:
        if workers < 1:
            raise ValueError(f"a pool needs at least one worker, not {workers}")
        self._count, self._grace = workers, grace
        self._workers: set[_Worker] = set()
        self._idle: asyncio.Queue[_Worker] = asyncio.Queue()
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="rollout")
        self._closed = False

    @property
    def pids(self) -> tuple[int, ...]:
        """Process ids of the workers, ascending."""
        return tuple(sorted(worker.pid for worker in self._workers))

    async def __aenter__(self) -> RolloutPool:
        for _ in range(self._count):
            self._start_worker()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End every worker and wait for its exit; rollouts in progress raise an error."""
        self._closed = True
        for worker in self._workers:
            worker.kill()
        self._threads.shutdown()
        for worker in self._workers:
            worker.connection.close()
        self._workers.clear()

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
        wall_limit: float = 60.0,
        recorded: bool = False,
    ) -> Rollout:
        """Run `simulate` in the next free workers, one trial in each; same arguments.

        Returns:
            What `simulate` would return; status `crashed` if a trial crashed two workers, `timeout`
            if its worker hung.

        Raises:
            UsageError: As `simulate` does.
            RuntimeError: `simulate` raised another error, which is a bug; includes the traceback.
        """
        options = {
            "rate": rate,
            "power": power,
            "interval": interval,
            "wall_limit": wall_limit,
            "recorded": recorded,
        }
        jobs = (
            {"machine": machine, "task": trial, "seed": seed, "variation": variation, **options}
            for trial in task.trials(seed)
        )
        return combine_trials(await asyncio.gather(*map(self._run_trial, jobs)))

    async def _run_trial(self, job: dict[str, Any]) -> Rollout:
        """Call `simulate` with these arguments in a worker, and again if that worker died."""
        timeout = job["wall_limit"] + self._grace
        for _ in range(ATTEMPTS):
            try:
                return await self._ask(job, timeout)
            except (EOFError, ConnectionError):
                continue
            except TimeoutError:
                return _without_score("timeout", f"no answer within {timeout:g} s")
        return _without_score("crashed", f"its process died {ATTEMPTS} times")

    async def _ask(self, job: dict[str, Any], timeout: float) -> Rollout:
        worker = await self._idle.get()
        while not worker.alive and not self._closed:  # it died while idle
            self._replace(worker)
            worker = await self._idle.get()
        loop = asyncio.get_running_loop()
        try:
            reply = await loop.run_in_executor(self._threads, worker.ask, job, timeout)
        except BaseException:  # died, hung or cancelled
            self._replace(worker)
            raise
        self._idle.put_nowait(worker)
        if isinstance(reply, UsageError):
            raise reply
        if isinstance(reply, str):
            raise RuntimeError(f"a rollout failed in its worker:\n{reply}")
        return reply

    def _start_worker(self) -> None:
        worker = _Worker()
        self._workers.add(worker)
        self._idle.put_nowait(worker)

    def _replace(self, worker: _Worker) -> None:
        self._workers.discard(worker)
        worker.kill()
        if not self._closed:
            self._start_worker()


class _Worker:
    """One process and the connection to it."""

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _CHILD, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env={**os.environ, **_ONE_THREAD, "PYTHONPATH": os.pathsep.join(sys.path)},
                **_passing(theirs.fileno()),
            )

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def ask(self, job: dict[str, Any], timeout: float) -> Rollout | UsageError | str:
        """Send a job and wait for the rollout, or the traceback of an error."""
        self.connection.send(job)
        if not self.connection.poll(timeout):
            raise TimeoutError
        reply: Rollout | UsageError | str = self.connection.recv()
        return reply

    def kill(self) -> None:
        """End the process and wait for its exit; a pending `ask` then gets an EOFError."""
        self._process.kill()
        self._process.wait()


def _passing(pipe: int) -> dict[str, Any]:
    """Arguments of `Popen` that pass a pipe, a handle on Windows, to the process."""
    if sys.platform == "win32":
        os.set_handle_inheritable(pipe, True)
        return {"startupinfo": subprocess.STARTUPINFO(lpAttributeList={"handle_list": [pipe]})}
    return {"pass_fds": [pipe]}


def _without_score(status: Status, why: str) -> Rollout:
    """A rollout that failed because of the computer, not the machine."""
    return Rollout(status, None, Feedback(f"No score: the simulation was cut off, {why}.", {}))
