"""How many rollouts go into one message."""

from __future__ import annotations

from collections import deque
from math import ceil
from statistics import median

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
        share = ceil(waiting / workers)
        return max(1, min(self._wanted, share, MOST))

    @property
    def cost(self) -> float:
        """Seconds that a message has cost beyond the work in it."""
        return median(self._costs) if self._costs else 0.0

    @property
    def work(self) -> float:
        """Seconds of a rollout."""
        return median(self._work) if self._work else 1.0

    @property
    def _wanted(self) -> int:
        return ceil(self.cost / (SHARE * max(self.work, 1e-6)))
