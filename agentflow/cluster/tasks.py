"""Coroutine functions that run on nodes of a cluster and report to this process."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util import get_node_ip_address

from agentflow.cluster.connection import (
    PLACE_LIMIT,
    let_go,
    no_place,
    require_same_versions,
    result_of,
    watch_cluster,
)
from agentflow.cluster.limits import SharedLimiters, start_keeper
from agentflow.cluster.worker import conditions
from agentflow.env.pool.base import ATTEMPTS
from agentflow.errors import AgentflowError, RunError
from agentflow.llm.wrappers.limits import Limiters

Tell = Callable[[Any], None]
"""Receives what a function reports while it runs."""
Work = Callable[[Limiters, Tell], Coroutine[Any, Any, Any]]
"""A coroutine function that can be pickled."""
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
        self._watch = asyncio.create_task(watch_cluster())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._watch.cancel()
        let_go(ray.kill, self._keeper)

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
            ended, report = await result_of(await first)
            while not ended:
                tell(report)
                ended, report = await result_of(await anext(reports))
            await anext(reports, None)
            return report
        except RayError:
            raise
        except BaseException:
            # Only what still runs: cancelling what has just ended makes Ray end this process.
            let_go(ray.cancel, reports, force=True)
            raise

    async def _wait_for_place(self, first: asyncio.Future[Any]) -> None:
        """Wait for a first report while others run; alone, no longer than a cluster may take."""
        while not (await asyncio.wait({first}, timeout=PLACE_LIMIT))[0]:
            if not self._running:
                first.cancel()
                raise no_place()


def _run(limiters: Limiters, work: Work, expected: Mapping[str, str]) -> Iterator[tuple[bool, Any]]:
    """Run a function in a thread; what it reports, then, marked as the end, what it returns."""
    require_same_versions(expected, conditions(), get_node_ip_address())
    reports: SimpleQueue[tuple[bool, Any]] = SimpleQueue()

    def tell(report: Any) -> None:
        reports.put((False, report))

    with ThreadPoolExecutor(1) as thread:
        done = thread.submit(asyncio.run, work(limiters, tell))
        done.add_done_callback(lambda _: reports.put((True, None)))
        while not (report := reports.get())[0]:
            yield report
        yield True, done.result()
