"""Structured concurrency: leave no task behind, and evaluate each candidate once."""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Awaitable, Callable, Coroutine, Iterable, Mapping
from typing import Any, Generic, TypeVar

from agentflow.search.node import C, Evaluate, Evaluation

S = TypeVar("S")
T = TypeVar("T")


async def run_concurrently(jobs: Iterable[Coroutine[Any, Any, T]]) -> list[T]:
    """Run jobs concurrently and return their results in order.

    If one fails, or this call is cancelled, cancel the others and wait for them to finish.
    """
    tasks = [asyncio.ensure_future(job) for job in jobs]
    try:
        return await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def work_in_order(
    items: Iterable[S], work: Callable[[S], Awaitable[T]], keep: Callable[[T], object], most: int
) -> None:
    """Work on items, at most `most` at a time; `keep` gets the results in the order of the items.

    After an error, no further item begins; it is raised when those in progress have ended, because
    their results, such as replies of a model, may be on record as well.
    """
    waiting: deque[asyncio.Future[T]] = deque()
    try:
        for item in items:
            waiting.append(asyncio.ensure_future(work(item)))
            if len(waiting) == most:
                keep(await waiting.popleft())
        while waiting:
            keep(await waiting.popleft())
    except Exception:
        await asyncio.gather(*waiting, return_exceptions=True)
        raise
    finally:
        for future in waiting:
            future.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)


class EvaluateOnce(Generic[C]):
    """Evaluates each distinct candidate once, even when it is requested twice concurrently.

    An evaluation is cancelled, and forgotten, once every request for it is cancelled.
    """

    def __init__(self, evaluate: Evaluate[C], known: Mapping[C, Evaluation] | None = None) -> None:
        """Wrap `evaluate`; candidates in `known` are never evaluated."""
        self._evaluate = evaluate
        self._known = dict(known or {})
        self._running: dict[C, asyncio.Task[Evaluation]] = {}
        self._requests: Counter[C] = Counter()
        self.count = 0
        """Evaluations started, without those cancelled."""

    def find(self, candidate: C) -> Evaluation | None:
        """A finished evaluation; None without one."""
        return self._known.get(candidate)

    @property
    def finished(self) -> Iterable[tuple[C, Evaluation]]:
        """The candidates with finished evaluations, in no particular order."""
        return self._known.items()

    async def __call__(self, candidate: C, label: str) -> Evaluation:
        """The candidate's evaluation, made under the label of its first request."""
        if candidate in self._known:
            return self._known[candidate]
        if candidate not in self._running:
            self._running[candidate] = asyncio.ensure_future(self._evaluate(candidate, label))
            self.count += 1
        job = self._running[candidate]
        self._requests[candidate] += 1
        try:
            self._known[candidate] = await asyncio.shield(job)
            return self._known[candidate]
        finally:
            self._requests[candidate] -= 1
            if not self._requests[candidate] and not job.done():
                del self._running[candidate]
                self.count -= 1
                job.cancel()
                await asyncio.gather(job, return_exceptions=True)
