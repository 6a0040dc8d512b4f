"""The loads of every step: greatest loads between samples, and before and after a moment."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from agentflow.env.measurements import Peak
from agentflow.env.physics.frames import WRENCH_ORDER
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Joint
from agentflow.env.rollout import Array, Broken
from agentflow.machine.geometry.vectors import Vec3

BLOCK = 256
"""Steps whose loads are stored together: copying into an array is faster than making one."""
MOST_PEAKS = 5
"""Most peaks kept before, and after, the decisive moment."""


class LoadHistory:
    """Keeps the loads of all joints in every step; E connections."""

    def __init__(self, loads: Loads, joints: tuple[Joint, ...]) -> None:
        self._loads, self._joints = loads, joints
        self._blocks: list[Array] = []
        self._block = np.empty((0, 0, 0))
        """The last one."""
        self._times: list[float] = []

    def add(self, time: float) -> None:
        """Keep the loads of the last step."""
        at = len(self._times) % BLOCK
        if not at:
            self._block = np.empty((BLOCK, len(self._joints), 6))
            self._blocks.append(self._block)
        self._block[at] = self._loads.level
        self._times.append(time)

    @cached_property
    def shares(self) -> Array:
        """(S, E) load over strength of every connection in every step; 0 once it broke."""
        last = len(self._times) - BLOCK * (len(self._blocks) - 1)
        filled = [*self._blocks[:-1], self._blocks[-1][:last]]
        columns = self._loads.connections
        return np.concatenate([np.sqrt(_squares(b.take(columns, 1)).max(axis=2)) for b in filled])

    def greatest(self, times: Array) -> Array:
        """(T, E) greatest load over strength since the time before, of increasing `times`, s."""
        ends = np.searchsorted(np.array(self._times), times + 1e-9, side="right")
        starts = np.minimum(np.concatenate([[0], ends[:-1]]), len(self.shares) - 1)
        found: Array = np.maximum.reduceat(self.shares, starts)
        return found

    def peaks(self, moment: float | None, broken: tuple[Broken, ...]) -> tuple[Peak, ...]:
        """The greatest loads up to and after a moment, s; None: of the whole rollout.

        A connection that broke has the load under which it broke.
        """
        times = np.array(self._times)
        split = len(times) if moment is None else int(np.searchsorted(times, moment, side="right"))
        found: list[Peak] = []
        for first, last in ((0, split), (split, len(times))):
            if first < last:
                part = self._greatest_between(first, last)
                low, high = times[first] - 1e-9, times[last - 1] + 1e-9
                part += [_as_it_broke(b, first > 0) for b in broken if low <= b.time <= high]
                found += _highest(part)
        return tuple(found)

    def _greatest_between(self, first: int, last: int) -> list[Peak]:
        rows = first + self.shares[first:last].argmax(axis=0)
        found = []
        for column, row in enumerate(rows.tolist()):
            joint = self._loads.connections[column]
            level = self._blocks[row // BLOCK][row % BLOCK, joint]
            force, moment = split_wrench(self._loads.wrench(level, joint))
            own, load = self._joints[joint], float(self.shares[row, column])
            time = self._times[row]
            found.append(Peak(own.block, own.partner, time, load, force, moment, first > 0))
        return found


def split_wrench(wrench: Array) -> tuple[Vec3, Vec3]:
    """Force and moment of (6,) numbers."""
    a, b, c, d, e, f = wrench.tolist()
    return (a, b, c), (d, e, f)


def _squares(levels: Array) -> Array:
    """(S, E, 2) squares of force and moment over strength, summed as `Loads` does."""
    ordered = levels.take(WRENCH_ORDER, 2)
    squares = (ordered * ordered).reshape(*levels.shape[:2], 2, 3)
    return np.asarray(squares[..., 0] + squares[..., 1] + squares[..., 2])


def _as_it_broke(item: Broken, after: bool) -> Peak:
    return Peak(item.block, item.partner, item.time, item.load, item.force, item.moment, after)


def _highest(peaks: list[Peak]) -> list[Peak]:
    """The highest ones, each connection once."""
    found: dict[tuple[int, int], Peak] = {}
    for peak in sorted(peaks, key=lambda peak: -peak.load):
        found.setdefault((peak.block, peak.partner), peak)
    return list(found.values())[:MOST_PEAKS]
