"""A pool of worker processes that run rollouts, and what all pools have in common, wherever their
workers are.

Each worker is a fresh interpreter at the other end of a pipe.
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Pipe
from pathlib import Path
from typing import Any, Protocol, TypeVar

from agentflow.env.pool.worker import Reply
from agentflow.env.rollout import Feedback, Rollout, Status
from agentflow.env.simulation.trials import combine_trials
from agentflow.env.simulation.variations import DEFAULT, Variation
from agentflow.env.tasks.base import Task
from agentflow.errors import UsageError
from agentflow.interpreter import python_command, python_environment
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


_CHILD = """
import signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
from agentflow.env.pool.worker import serve
serve(int(sys.argv[1]))
"""
"""Ignores interrupts, which a terminal sends to all processes: the parent handles them."""
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""Physics uses no BLAS; BLAS threads would only cost start-up time and memory."""

STARVED = 0.001
"""Least share of the time for which a worker that does not hang gets a processor."""


class RolloutPool(Pool):
    """A pool of worker processes on this computer."""

    def __init__(self, workers: int, grace: float = GRACE) -> None:
        super().__init__(workers)
        self._grace = grace
        self._workers: set[_Worker] = set()
        self._idle: asyncio.Queue[_Worker] = asyncio.Queue()
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="rollout")
        self._closed = False

    @property
    def pids(self) -> tuple[int, ...]:
        """Process ids of the workers, ascending."""
        return tuple(sorted(worker.pid for worker in self._workers))

    async def _start(self) -> None:
        for _ in range(self.workers):
            self._start_worker()

    async def _stop(self) -> None:
        self._closed = True
        for worker in self._workers:
            worker.kill()
        self._threads.shutdown()
        for worker in self._workers:
            worker.connection.close()
        self._workers.clear()

    async def _run_trial(self, job: dict[str, Any]) -> Rollout:
        timeout = job["cpu_limit"] + self._grace
        for _ in range(ATTEMPTS):
            try:
                return await self._ask(job, timeout)
            except (EOFError, ConnectionError):
                continue
            except TimeoutError:
                return hung_rollout(timeout)
        return crashed_rollout()

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
        return rollout_in(reply)

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
                python_command(_CHILD, str(theirs.fileno())),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env={**python_environment(), **_ONE_THREAD},
                **_passing(theirs.fileno()),
            )

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def ask(self, job: dict[str, Any], timeout: float) -> Reply:
        """Send a job and wait for the rollout, or the traceback of an error.

        Raises:
            TimeoutError: It has computed for so many seconds, or waited as long for something else
                than a processor.
        """
        self.connection.send(job)
        begin = last = computed_by(self.pid)
        while not self.connection.poll(timeout):
            now = computed_by(self.pid)
            if now - begin >= timeout or now - last < STARVED * timeout:
                raise TimeoutError
            last = now
        reply: Reply = self.connection.recv()
        return reply

    def kill(self) -> None:
        """End the process and wait for its exit; a pending `ask` then gets an EOFError."""
        self._process.kill()
        self._process.wait()


def computed_by(process: int) -> float:
    """Seconds for which a process has computed; 0 where the system has no file that says so."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except OSError:
        return 0.0


def _passing(pipe: int) -> dict[str, Any]:
    """Arguments of `Popen` that pass a pipe, a handle on Windows, to the process."""
    if sys.platform == "win32":
        os.set_handle_inheritable(pipe, True)
        return {"startupinfo": subprocess.STARTUPINFO(lpAttributeList={"handle_list": [pipe]})}
    return {"pass_fds": [pipe]}
