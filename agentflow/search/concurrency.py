"""Owns running things at once: all of them or none left over, and each distinct thing once."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Iterable, Mapping
from typing import Any, Generic, TypeVar

from agentflow.search.node import C, Evaluate, Evaluation

T = TypeVar("T")


async def run_concurrently(jobs: Iterable[Coroutine[Any, Any, T]]) -> list[T]:
    """Run jobs at once and return their results in order.

    When one fails, or this call is cancelled, the others are cancelled and waited for, so that
    nothing runs on behind the caller's back.
    """
    tasks = [asyncio.ensure_future(job) for job in jobs]
    try:
        return await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


class EvaluateOnce(Generic[C]):
    """An evaluation that tries every distinct candidate once, also when two ask at one moment."""

    def __init__(self, evaluate: Evaluate[C], known: Mapping[C, Evaluation] | None = None) -> None:
        """Wrap `evaluate`; what `known` holds is never tried."""
        self._evaluate = evaluate
        self._known = dict(known or {})
        self._running: dict[C, asyncio.Future[Evaluation]] = {}
        self.count = 0
        """Candidates really tried."""

    async def __call__(self, candidate: C, label: str) -> Evaluation:
        """The candidate's evaluation; the label of whoever asks first is handed on."""
        if candidate in self._known:
            return self._known[candidate]
        if candidate not in self._running:
            self._running[candidate] = asyncio.ensure_future(self._evaluate(candidate, label))
            self.count += 1
        return await self._running[candidate]
