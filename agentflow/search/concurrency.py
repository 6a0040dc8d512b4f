"""Structured concurrency: leave no task behind, and evaluate each candidate once."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Iterable, Mapping
from typing import Any, Generic, TypeVar

from agentflow.search.node import C, Evaluate, Evaluation

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


class EvaluateOnce(Generic[C]):
    """Evaluates each distinct candidate once, even when it is requested twice concurrently."""

    def __init__(self, evaluate: Evaluate[C], known: Mapping[C, Evaluation] | None = None) -> None:
        """Wrap `evaluate`; candidates in `known` are never evaluated."""
        self._evaluate = evaluate
        self._known = dict(known or {})
        self._running: dict[C, asyncio.Future[Evaluation]] = {}
        self.count = 0
        """Evaluations started."""

    async def __call__(self, candidate: C, label: str) -> Evaluation:
        """The candidate's evaluation, made under the label of its first request."""
        if candidate in self._known:
            return self._known[candidate]
        if candidate not in self._running:
            self._running[candidate] = asyncio.ensure_future(self._evaluate(candidate, label))
            self.count += 1
        return await self._running[candidate]
