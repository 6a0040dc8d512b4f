"""Time in tests that no slow or busy machine can fail: growth, comparisons, a clock that jumps."""

from __future__ import annotations

import asyncio
import gc
import selectors
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

Input = TypeVar("Input")
Output = TypeVar("Output")

GROWTH = 4
"""How much larger the larger input is."""
MOST = 10
"""How much longer it may take: linear work takes 4 times as long, quadratic work 16 times."""
ROUNDS = 5
"""How often both are timed before a test fails; the fastest times count."""
PATIENCE_S = 2.0
"""Work that takes longer is not timed again: noise is a small part of it."""


def assert_linear(
    work: Callable[[Input], object], grown: Callable[[int], Input], size: int
) -> None:
    """Time work on inputs of a quarter of `size` and of `size`, in turns; compare the two times.

    Whatever slows a machine down for a moment slows single rounds; work that is not linear slows
    them all.
    """
    inputs = grown(size // GROWTH), grown(size)
    small = large = float("inf")
    for _ in range(ROUNDS):
        small = min(small, *(seconds(work, inputs[0]) for _ in range(2)))
        large = min(large, seconds(work, inputs[1]))
        if large < MOST * small:
            return
        if large > PATIENCE_S:
            break
    raise AssertionError(f"{GROWTH} times the size took {large / small:.0f} times as long")


def seconds(work: Callable[[Input], object], given: Input) -> float:
    """Processor seconds of this thread, without garbage collection."""
    return timed(work, given)[1]


def timed(work: Callable[[Input], Output], given: Input) -> tuple[Output, float]:
    """What the work returns, and its seconds."""
    with _uncollected():
        start = time.thread_time()
        output = work(given)
        return output, time.thread_time() - start


@contextmanager
def _uncollected() -> Iterator[None]:
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def repeated(unit: str, start: str = "", end: str = "") -> Callable[[int], str]:
    """Texts of about as many characters as asked, most of them repetitions of one unit."""
    return lambda size: start + unit * (size // len(unit)) + end


class JumpingLoop(asyncio.SelectorEventLoop):
    """An event loop whose clock jumps ahead whenever there is nothing to do but wait."""

    def __init__(self) -> None:
        self.now = 0.0
        super().__init__(_Jump(self))

    def time(self) -> float:
        return self.now


class _Jump(selectors.SelectSelector):
    def __init__(self, loop: JumpingLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> list[Any]:
        self._loop.now += timeout or 0.0
        return super().select(0)
