"""A pool whose workers are Ray actors, on this machine or on the nodes of a cluster; and what runs
in them."""

import asyncio
import pickle
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil
from statistics import median
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util import get_node_ip_address

from agentflow.cluster import connection
from agentflow.env.constants import constants
from agentflow.env.physics.engines import installed_engines
from agentflow.env.pool.pool import ATTEMPTS, GRACE, Pool, crashed_rollout, hung_rollout, rollout_in
from agentflow.env.pool.worker import Reply, run_job
from agentflow.env.rollout import Rollout
from agentflow.errors import ConfigError
from agentflow.machine.blocks.library import library
from agentflow.version import __version__

Batch = Sequence[bytes]
"""Pickled arguments of `simulate`. Ray carries bytes only: arrays would stay in its object store,
read-only, for as long as anybody holds their rollout."""


class Worker:
    """Plays rollouts one after another; Ray makes an actor of it, and its engine stays loaded."""

    def conditions(self) -> tuple[dict[str, str], str]:
        """What this process would simulate with, and the address of its node."""
        return conditions(), get_node_ip_address()

    def run_batch(self, batch: Batch) -> tuple[bytes, float]:
        """The pickled replies to a batch, in its order, and the seconds that the work took."""
        begin = time.perf_counter()
        replies = [_run_job(job) for job in batch]
        work = time.perf_counter() - begin
        return pickle.dumps(replies, pickle.HIGHEST_PROTOCOL), work


def conditions() -> dict[str, str]:
    """What decides the results of rollouts here: name -> version or digest."""
    engines = {spec.name: spec.identity.version for spec in installed_engines()}
    return {
        "agentflow": __version__,
        "constants": constants().digest,
        "blocks": library().digest,
        **engines,
    }


def _run_job(job: bytes) -> Reply:
    try:
        arguments = pickle.loads(job)
    except Exception as error:  # noqa: BLE001 - such as a plugin that is not installed here
        return f"{type(error).__name__}: {error}"
    return run_job(arguments)


SHARE = 0.02
"""A message may cost this share of the work in it."""
MOST = 64
"""Rollouts in a message at most: about 2 MB of results."""
RECENT = 31
"""Messages whose median counts."""


class Pace:
    """Chooses the size of batches by what recent ones have cost."""

    def __init__(self) -> None:
        self._costs: deque[float] = deque(maxlen=RECENT)
        self._work: deque[float] = deque(maxlen=RECENT)

    def note(self, elapsed: float, work: float, rollouts: int) -> None:
        """Take account of a batch: seconds from sending to reply, and those of its rollouts."""
        self._costs.append(max(elapsed - work, 0.0))
        self._work.append(work / rollouts)

    def size(self, waiting: int, workers: int) -> int:
        """Rollouts for the next batch: no more than a worker's share of those that wait."""
        wanted = ceil(self.cost / (SHARE * max(self.work, 1e-6)))
        return max(1, min(wanted, ceil(waiting / workers), MOST))

    @property
    def cost(self) -> float:
        """Seconds that a message has cost beyond the work in it."""
        return median(self._costs) if self._costs else 0.0

    @property
    def work(self) -> float:
        """Seconds of a rollout."""
        return median(self._work) if self._work else 1.0


STARVED = 20
"""By how much workers may be slowed by others: how long they compute is not known here."""
STARTS = 3
"""Times in a row that a worker may die before it is ready."""


@dataclass(eq=False)
class _Trial:
    """A trial that waits for a worker, or is with one.

    After `limit` seconds, its worker counts as hung. It goes `alone` into a batch once one came to
    harm with it.
    """

    job: bytes
    limit: float
    reply: asyncio.Future[Reply] = field(default_factory=asyncio.Future)
    deaths: int = 0
    alone: bool = False

    def settle(self, reply: Reply) -> None:
        if not self.reply.done():  # else nobody waits for it any more
            self.reply.set_result(reply)


class RayPool(Pool):
    """A pool of Ray actors, each of which takes one processor of the cluster.

    Workers beyond the processors that are free start as soon as some are.
    """

    def __init__(self, workers: int, grace: float = STARVED * GRACE) -> None:
        super().__init__(workers)
        self._grace = grace
        self._waiting: asyncio.Queue[_Trial] = asyncio.Queue()
        self._unsettled: set[_Trial] = set()
        self.pace = Pace()
        self._tasks: list[asyncio.Task[None]] = []
        self._ready = asyncio.Event()
        self._fault: BaseException | None = None
        """Why no worker can run anything any more."""

    async def _start(self) -> None:
        connection.connect(self.workers)
        work = [connection.watch_cluster(), *(self._keep_worker() for _ in range(self.workers))]
        self._tasks = [asyncio.create_task(each) for each in work]
        for task in self._tasks:
            task.add_done_callback(self._give_up)
        try:
            await asyncio.wait_for(self._ready.wait(), connection.PLACE_LIMIT)
            self._raise_fault()
        except asyncio.TimeoutError:
            await self._stop()
            raise connection.no_place() from None
        except BaseException:
            await self._stop()
            raise

    async def _stop(self) -> None:
        for task in self._tasks:
            task.cancel()
        for trial in self._unsettled:
            trial.reply.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _run_trial(self, job: dict[str, Any]) -> Rollout:
        self._raise_fault()
        trial = _Trial(pickle.dumps(job), job["cpu_limit"] + self._grace)
        self._unsettled.add(trial)
        self._waiting.put_nowait(trial)
        try:
            return rollout_in(await trial.reply)
        finally:
            trial.reply.cancel()
            self._unsettled.discard(trial)

    def _raise_fault(self) -> None:
        if self._fault is not None:
            raise self._fault

    def _give_up(self, task: asyncio.Task[None]) -> None:
        """Pass what ended a task to everybody who waits for a rollout."""
        if task.cancelled() or self._fault is not None:
            return
        self._fault = task.exception()
        self._ready.set()
        for trial in self._unsettled:
            if self._fault is not None and not trial.reply.done():
                trial.reply.set_exception(self._fault)

    async def _keep_worker(self) -> None:
        """Keep one worker at work; start another when it dies."""
        failures = 0
        actor = ray.remote(Worker).options(num_cpus=1, max_restarts=0, max_task_retries=0)
        while True:
            worker = actor.remote()
            try:
                theirs, node = await connection.result_of(worker.conditions.remote())
                connection.require_same_versions(conditions(), theirs, node)
                failures = 0
                self._ready.set()
                while await self._run_batch(worker, await self._next_batch()):
                    pass
            except RayError as error:  # before it was ready
                failures += 1
                if isinstance(error, RayTaskError) or failures == STARTS:
                    why = str(error).strip().rpartition("\n")[2]
                    raise ConfigError(f"a node cannot start a worker: {why}") from error
            finally:
                connection.let_go(ray.kill, worker)

    async def _next_batch(self) -> list[_Trial]:
        batch = [await self._waiting.get()]
        size = self.pace.size(self._waiting.qsize() + 1, self.workers)
        while len(batch) < size and not batch[0].alone and not self._waiting.empty():
            trial = self._waiting.get_nowait()
            if trial.alone:
                self._waiting.put_nowait(trial)
                break
            batch.append(trial)
        return [trial for trial in batch if not trial.reply.done()]

    async def _run_batch(self, worker: Any, batch: list[_Trial]) -> bool:
        """Have a worker run a batch; whether it can run another."""
        if not batch:
            return True
        begin = time.perf_counter()
        limit = max(trial.limit for trial in batch)
        try:
            sent = worker.run_batch.remote([trial.job for trial in batch])
            replies, work = await asyncio.wait_for(connection.result_of(sent), limit)
        except asyncio.TimeoutError:
            self._retry(batch, hung=True)
            return False
        except RayTaskError as error:
            raise RuntimeError(f"a worker failed:\n{error}") from error
        except RayError:  # its process or its node is gone, or cannot be reached
            self._retry(batch, hung=False)
            return False
        self.pace.note(time.perf_counter() - begin, work, len(batch))
        for trial, reply in zip(batch, pickle.loads(replies), strict=True):
            trial.settle(reply)
        return True

    def _retry(self, batch: list[_Trial], hung: bool) -> None:
        """Run the trials of a lost worker again, each alone, or record what they did to it.

        In a batch, nobody knows which one it was.
        """
        for trial in batch:
            trial.deaths += not hung
            if hung and len(batch) == 1:
                trial.settle(hung_rollout(trial.limit))
            elif trial.deaths == ATTEMPTS:
                trial.settle(crashed_rollout())
            else:
                trial.alone = True
                self._waiting.put_nowait(trial)
