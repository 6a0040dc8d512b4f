"""Tuning: better numbers of a candidate whose structure stays, by CMA-ES (Hansen 2016)."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np

from agentflow.extras import is_installed, missing

C = TypeVar("C")
WIDE = 1000.0
"""Width from which bounds tell nothing about useful values."""
STEP = 0.15
"""First standard deviation, as a share of the width between the bounds."""
MOST_IDLE = 20
"""Generations in a row without a new candidate after which tuning ends."""


class Bounded(Protocol):
    """A number that may change, and its bounds."""

    @property
    def value(self) -> float: ...
    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...


def require_cma() -> None:
    """Raise ConfigError unless cma is installed; this does not import it."""
    if not is_installed("cma"):
        raise missing("cma", "tune")


class Cma:
    """Proposes values of numbers, a generation at a time, and learns from their scores."""

    def __init__(self, numbers: Sequence[Bounded], seed: int) -> None:
        """Begin at the numbers' own values; they are scaled to their bounds."""
        import cma  # an extra

        bounds = np.array([_bounds(number) for number in numbers])
        self._low, self._width = bounds[:, 0], bounds[:, 1] - bounds[:, 0]
        first = (np.array([number.value for number in numbers]) - self._low) / self._width
        draws = np.random.default_rng(seed)
        options = {
            "bounds": [0, 1],
            "randn": lambda *shape: draws.standard_normal(shape),
            "seed": np.nan,  # or it would seed NumPy for the whole process
            "verbose": -9,
        }
        self._search: Any = cma.CMAEvolutionStrategy(first.clip(0, 1), STEP, options)
        self._asked: list[Any] = []

    def ask(self) -> list[list[float]]:
        """The values of the next generation."""
        self._asked = self._search.ask()
        return [(self._low + self._width * item).tolist() for item in self._asked]

    def tell(self, scores: Sequence[float | None]) -> None:
        """The scores of what was asked last; None is worse than all others."""
        known = [score for score in scores if score is not None]
        worst = min(known, default=0.0) - 1.0
        self._search.tell(self._asked, [-(worst if s is None else s) for s in scores])

    @property
    def ended(self) -> bool:
        """Whether it has converged."""
        return bool(self._search.stop())


def _bounds(number: Bounded) -> tuple[float, float]:
    """Bounds of the search: those of the number, or around its value where these are wide."""
    if number.high - number.low <= WIDE:
        return number.low, number.high
    around = 3 * abs(number.value) or 1.0
    return max(number.low, number.value - around), min(number.high, number.value + around)


async def tune(
    source: Cma,
    build: Callable[[Sequence[float]], C | None],
    judge: Callable[[Sequence[C], int], Awaitable[Sequence[float | None]]],
    start: C,
    score: float | None,
    most: int,
    greatest: float | None = None,
) -> tuple[C, float | None]:
    """The best candidate and its score: the start unless another one scores higher.

    Args:
        source: Proposes numbers.
        build: Makes a candidate of them; None if they do not fit together.
        judge: Gives the scores of different new candidates of a generation, counted from 1.
        start: Where it begins.
        score: The score of the start.
        most: Most candidates to judge.
        greatest: Score that no candidate can exceed, which ends the search.
    """
    known, generation, idle = {start: score}, 0, 0
    best = start

    def worth(candidate: C) -> float:
        return -np.inf if (found := known[candidate]) is None else found

    while most > 0 and idle < MOST_IDLE and worth(best) != greatest and not source.ended:
        made = [build(values) for values in source.ask()]
        new = [c for c in dict.fromkeys(made) if c is not None and c not in known][:most]
        idle = 0 if new else idle + 1
        generation, most = generation + bool(new), most - len(new)
        if new:
            known.update(zip(new, await judge(new, generation), strict=True))
            best = max((best, *new), key=worth)
        if all(c is None or c in known for c in made):
            source.tell([None if c is None else known[c] for c in made])
    return best, known[best]
