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
from pathlib import Path
from typing import Any

from agentflow.env.pool.base import ATTEMPTS, GRACE, Pool, crashed_rollout, hung_rollout, rollout_in
from agentflow.env.pool.worker import Reply
from agentflow.env.rollout import Rollout
from agentflow.interpreter import python_command, python_environment

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
