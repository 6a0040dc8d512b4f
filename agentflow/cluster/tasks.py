"""Coroutine functions that run on nodes of a cluster and report to this process.

Clients on all nodes share rate limits: one actor keeps them, the others ask it.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any
from uuid import uuid4

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util import get_node_ip_address
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from agentflow.cluster import connection
from agentflow.cluster.pool import conditions
from agentflow.env.pool.pool import ATTEMPTS
from agentflow.errors import AgentflowError, RunError
from agentflow.llm.settings import LimitSettings
from agentflow.llm.wrappers.limits import Limiter, Limiters, RateLimits, StartedCall

WAITING = 100_000
"""Calls that may wait at once."""


@dataclass
class _Turn:
    """A call that waits or has begun, and the tokens that it used, once it has ended."""

    begun: asyncio.Future[None] = field(default_factory=asyncio.Future)
    ended: asyncio.Future[int | None] = field(default_factory=asyncio.Future)

    async def take(self, limiter: Limiter, tokens: int) -> None:
        try:
            async with limiter.call(tokens) as call:
                self.begun.set_result(None)
                call.used = await self.ended
        finally:
            self.begun.cancel()


class Keeper:
    """Keeps the limits of every endpoint; Ray makes an actor of it."""

    def __init__(self) -> None:
        self._limiters: dict[str, Limiter] = {}
        self._turns: dict[tuple[str, str], tuple[_Turn, asyncio.Task[None]]] = {}

    async def begin(
        self, user: str, name: str, base_url: str, settings: LimitSettings, tokens: int
    ) -> None:
        """Wait until a call may begin, which its user has named."""
        limiter = self._limiters.setdefault(base_url, Limiter(settings))
        turn = _Turn()
        self._turns[user, name] = turn, asyncio.create_task(turn.take(limiter, tokens))
        await turn.begun

    async def end(self, user: str, name: str, used: int | None) -> None:
        """End a call, or give up one that waits."""
        turn, task = self._turns.pop((user, name))
        if turn.begun.done():
            turn.ended.set_result(used)
        else:
            task.cancel()

    async def forget(self, user: str) -> None:
        """End all calls of a user that is gone."""
        for key in [key for key in self._turns if key[0] == user]:
            _, task = self._turns.pop(key)
            task.cancel()


def start_keeper() -> Any:
    """Start the actor, on the node of this process: it is gone only if that is."""
    here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
    options = {"num_cpus": 0, "max_concurrency": WAITING, "scheduling_strategy": here}
    return ray.remote(Keeper).options(**options).remote()


@dataclass(frozen=True)
class SharedLimiters:
    """The limiters that a keeper keeps, for one of its users."""

    keeper: Any
    user: str

    def of(self, base_url: str, settings: LimitSettings) -> RateLimits:
        """The limits of an endpoint; those that any user asked for first hold."""
        return _SharedLimits(self.keeper, self.user, base_url, settings)


@dataclass(frozen=True)
class _SharedLimits:
    keeper: Any
    user: str
    base_url: str
    settings: LimitSettings

    @asynccontextmanager
    async def call(self, tokens: int) -> AsyncIterator[StartedCall]:
        """See `RateLimits`."""
        call, name = StartedCall(), uuid4().hex
        begin = self.keeper.begin.remote(self.user, name, self.base_url, self.settings, tokens)
        try:
            await connection.result_of(begin)
            yield call
        finally:
            self.keeper.end.remote(self.user, name, call.used)


Tell = Callable[[Any], None]
Work = Callable[[Limiters, Tell], Coroutine[Any, Any, Any]]
PAUSE = 5.0
"""Seconds after a node was lost, in which what ran there lets go of its files."""


class LostError(RunError):
    """The nodes on which a function ran were lost, one after another."""


class Tasks:
    """Runs coroutine functions, each with `processors` of one node; they share rate limits."""

    def __init__(self, processors: int) -> None:
        nodes = [node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"]]
        self.processors = max(1, min(processors, int(max(nodes)) or processors))
        """Of one node: no more than the largest has."""
        self._keeper = start_keeper()
        # Once for all runs: for each function, Ray waits for the head, and all else waits with it.
        self._function = ray.remote(_run).options(
            num_cpus=self.processors, max_retries=0, num_returns="streaming"
        )
        self._running: set[str] = set()

    async def __aenter__(self) -> Tasks:
        self._watch = asyncio.create_task(connection.watch_cluster())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._watch.cancel()
        connection.let_go(ray.kill, self._keeper)

    async def run(self, name: str, work: Work, tell: Tell) -> Any:
        """What the function returns; it starts again elsewhere if its node is lost.

        Raises:
            LostError: That happened too often.
            AgentflowError: A node has other versions, or the head is gone.
            RuntimeError: The function raised an error.
        """
        found = asyncio.create_task(self._repeat(name, work, tell))
        try:
            await asyncio.wait({found, self._watch}, return_when=asyncio.FIRST_COMPLETED)
            return found.result() if found.done() else self._watch.result()
        finally:
            found.cancel()
            await asyncio.gather(found, return_exceptions=True)

    async def _repeat(self, name: str, work: Work, tell: Tell) -> Any:
        for attempt in range(ATTEMPTS):
            user = f"{name} {attempt}"
            try:
                return await self._attempt(user, work, tell)
            except RayTaskError as error:
                if isinstance(error.cause, AgentflowError):
                    raise error.cause from None
                raise RuntimeError(f"a task failed on its node:\n{error}") from error
            except RayError:  # its process or its node is gone, or cannot be reached
                await asyncio.sleep(PAUSE)
            finally:
                self._running.discard(user)
                self._keeper.forget.remote(user)
        raise LostError(f"the node that carried out {name} was lost {ATTEMPTS} times")

    async def _attempt(self, user: str, work: Work, tell: Tell) -> Any:
        reports = self._function.remote(SharedLimiters(self._keeper, user), work, conditions())
        try:
            first = asyncio.ensure_future(anext(reports))
            await self._wait_for_place(first)
            self._running.add(user)
            ended, report = await connection.result_of(await first)
            while not ended:
                tell(report)
                ended, report = await connection.result_of(await anext(reports))
            await anext(reports, None)
            return report
        except RayError:
            raise
        except BaseException:
            # Only what still runs: cancelling what has just ended makes Ray end this process.
            connection.let_go(ray.cancel, reports, force=True)
            raise

    async def _wait_for_place(self, first: asyncio.Future[Any]) -> None:
        """Wait for a first report while others run; alone, no longer than a cluster may take."""
        while not (await asyncio.wait({first}, timeout=connection.PLACE_LIMIT))[0]:
            if not self._running:
                first.cancel()
                raise connection.no_place()


def _run(limiters: Limiters, work: Work, expected: Mapping[str, str]) -> Iterator[tuple[bool, Any]]:
    """Run a function in a thread; what it reports, then, marked as the end, what it returns."""
    connection.require_same_versions(expected, conditions(), get_node_ip_address())
    reports: SimpleQueue[tuple[bool, Any]] = SimpleQueue()

    def tell(report: Any) -> None:
        reports.put((False, report))

    with ThreadPoolExecutor(1) as thread:
        done = thread.submit(asyncio.run, work(limiters, tell))
        done.add_done_callback(lambda _: reports.put((True, None)))
        while not (report := reports.get())[0]:
            yield report
        yield True, done.result()
