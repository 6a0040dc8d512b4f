"""What is noted during a rollout besides its samples: loads of every step, contacts, and work."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agentflow.env.measurements import Contact, Drawn, Energy, Hit, Peak
from agentflow.env.physics.engine import Touch
from agentflow.env.physics.frames import WRENCH_ORDER
from agentflow.env.physics.loads import Loads
from agentflow.env.physics.model import Joint
from agentflow.env.rollout import Array, Broken
from agentflow.env.scene import Body
from agentflow.machine.geometry.vectors import Vec3

BLOCK = 256
"""Steps whose loads are summed at once, which caches hold."""
MOST_PEAKS = 5
"""Most peaks kept before, and after, the decisive moment."""
RECOIL = 0.2
"""Time after the decisive moment in which loads are those just after it, s."""
LONGEST = 0.1
"""Longest time over which the impulse of a hit is summed, s: bodies that rest on each other press
for ever."""
MEAN = 0.1
"""Over which a power is a mean, s."""
DISTURBED = 0.1
"""For how long loads do not count that another length of steps makes of what rests on contacts, s:
up to 7 % more of a machine that stands, for 0.05 s."""


class LoadHistory:
    """The loads of all joints in every step; E connections."""

    def __init__(self, loads: Loads, joints: tuple[Joint, ...]) -> None:
        self._loads, self._joints = loads, joints
        self._levels: list[Array] = []
        """(S, J, 6) those of one or more steps each."""
        self._times: list[float] = []
        self._disturbed: list[float] = []
        """When the simulation disturbed what rested, s."""

    def disturb(self, time: float) -> None:
        """Note that what rests is disturbed by another length of steps from a time on, s."""
        self._disturbed.append(time)

    def add(self, time: float) -> None:
        """Keep the loads of the last step."""
        self._levels.append(self._loads.level[None])
        self._times.append(time)

    def extend(self, times: list[float], levels: Array) -> None:
        """Keep the loads of several steps, (S, J, 6)."""
        self._times += times
        self._levels.append(levels)

    def steps_until(self, times: Array | Sequence[float]) -> NDArray[np.intp]:
        """Steps from the first one that was kept, which is t = 0, to each of some times, s."""
        return np.searchsorted(self._clock, np.array(times) + 1e-9, side="right") - 1

    def times_until(self, time: float) -> list[float]:
        """The times of these steps, s, the first of which is 0."""
        return self._times[: bisect(self._times, time + 1e-9)]

    @cached_property
    def _clock(self) -> Array:
        """The times of all steps, s, once the rollout is over."""
        return np.array(self._times)

    @cached_property
    def _table(self) -> Array:
        """(S, J, 6) the loads of all steps, once the rollout is over."""
        return np.concatenate(self._levels)

    @cached_property
    def shares(self) -> Array:
        """(S, E) load over strength of every connection in every step; 0 once it broke."""
        levels, columns = self._table, self._loads.connections
        blocks = (levels[first : first + BLOCK] for first in range(0, len(levels), BLOCK))
        return np.concatenate([_shares(block.take(columns, 1)) for block in blocks])

    def greatest(self, times: Array) -> Array:
        """(T, E) greatest load over strength since the time before, of increasing `times`, s."""
        ends = np.searchsorted(self._clock, times + 1e-9, side="right")
        starts = np.minimum(np.concatenate([[0], ends[:-1]]), len(self.shares) - 1)
        found: Array = np.maximum.reduceat(self.shares, starts)
        return found

    def peaks(self, moment: float | None, broken: tuple[Broken, ...]) -> tuple[Peak, ...]:
        """The greatest loads up to and after a moment, s; None: of the whole rollout.

        A connection that broke has the load under which it broke.
        """
        split = len(self._times) if moment is None else bisect(self._times, moment)
        last = len(self._times)
        return (*self._highest(0, split, broken), *self._highest(split, last, broken))

    def recoil(self, moment: float | None, broken: tuple[Broken, ...]) -> tuple[Peak, ...]:
        """The greatest loads just after a moment, s, as in `peaks`; none without a moment."""
        if moment is None:
            return ()
        first, last = (bisect(self._times, moment + later) for later in (0.0, RECOIL))
        return tuple(self._highest(first, last, broken))

    def _highest(self, first: int, last: int, broken: tuple[Broken, ...]) -> list[Peak]:
        if first >= last:
            return []
        part = self._greatest_between(first, last)
        low, high = self._times[first] - 1e-9, self._times[last - 1] + 1e-9
        part += [_as_it_broke(b, first > 0) for b in broken if low <= b.time <= high]
        return _highest(part)

    def drawn(self, works: Array) -> Drawn:
        """What was drawn; `works` (S, 3) are as `World.works`, of the steps that are kept."""
        times, work = self._clock, works[:, 0] + works[:, 1]
        ends = np.append(np.arange(0.0, times[-1], MEAN), times[-1])
        given = np.maximum(np.diff(np.interp(ends, times, work)), 0.0)
        if not given.size:
            return Drawn(0.0, 0.0, 0.0)
        most = int(given.argmax())
        return Drawn(float(given.sum()), float(given[most]) / MEAN, float(ends[most + 1]))

    def _greatest_between(self, first: int, last: int) -> list[Peak]:
        rows = first + self.shares[first:last].argmax(axis=0)
        return [self._peak(row, column, first > 0) for column, row in enumerate(rows.tolist())]

    def _peak(self, row: int, column: int, after: bool) -> Peak:
        joint = self._loads.connections[column]
        force, moment = split_wrench(self._loads.wrench(self._table[row, joint], joint))
        own, load = self._joints[joint], float(self.shares[row, column])
        return Peak(own.block, own.partner, self._times[row], load, force, moment, after)

    def greatest_peak(self) -> Peak | None:
        """The greatest load of all that held, where nothing was disturbed; None without any."""
        times, shares = self._clock, self.shares.copy()
        for begin in self._disturbed:
            shares[(times > begin) & (times <= begin + DISTURBED)] = 0.0
        if not shares.any():
            return None
        row, column = divmod(int(shares.argmax()), shares.shape[1])
        return self._peak(row, column, after=False)


def split_wrench(wrench: Array) -> tuple[Vec3, Vec3]:
    """Force and moment of (6,) numbers."""
    a, b, c, d, e, f = wrench.tolist()
    return (a, b, c), (d, e, f)


def _shares(levels: Array) -> Array:
    """(S, E) force or moment over strength, whichever is greater, summed as `Loads` does."""
    squares = levels * levels
    a, b, c, p, q, r = (squares[..., i] for i in WRENCH_ORDER)
    return np.sqrt(np.maximum(a + b + c, p + q + r))


def _as_it_broke(item: Broken, after: bool) -> Peak:
    return Peak(item.block, item.partner, item.time, item.load, item.force, item.moment, after)


def _highest(peaks: list[Peak]) -> list[Peak]:
    """The highest ones, each connection once."""
    found: dict[tuple[int, int], Peak] = {}
    for peak in sorted(peaks, key=lambda peak: -peak.load):
        found.setdefault((peak.block, peak.partner), peak)
    return list(found.values())[:MOST_PEAKS]


@dataclass
class _Pair:
    """Two bodies that touched."""

    standing: bool
    begin: float
    """Time at which the current hit began, s."""
    place: Vec3
    seen: float
    """Time at which they last touched, s."""
    impulse: float
    first: Hit | None = None
    hardest: Hit | None = None

    def close(self) -> None:
        """End the current hit."""
        if self.hardest is None or self.impulse > self.hardest.impulse:
            self.hardest = Hit(self.begin, self.place, self.impulse)
            self.first = self.first or self.hardest


class ContactLog:
    """First and hardest hit of each two bodies that touched; `step` is the length of a step, s."""

    def __init__(self, step: float) -> None:
        self._step = step
        self._pairs: dict[tuple[Body, Body], _Pair] = {}

    def add(self, time: float, touches: Sequence[Touch]) -> bool:
        """Add one reading; returns whether any two bodies touched for the first time.

        Readings may skip steps: a hit ends when a pair is missing from a reading or a step was
        skipped.
        """
        pairs, new = self._pairs, False
        for a, b, place, force in touches:
            pair = pairs.get((a, b))
            if pair is None:
                pairs[a, b] = _Pair(time <= 0.0, time, place, time, force * self._step)
                new = True
            elif time - pair.seen < 1.5 * self._step and time - pair.begin < LONGEST:
                pair.seen, pair.impulse = time, pair.impulse + force * self._step
            else:
                pair.close()
                pair.begin = pair.seen = time
                pair.place, pair.impulse = place, force * self._step
        return new

    def contacts(self) -> tuple[Contact, ...]:
        """All contacts in order of time."""
        found = []
        for (a, b), pair in self._pairs.items():
            pair.close()
            assert pair.first is not None
            assert pair.hardest is not None
            found.append(Contact(a, b, pair.first, pair.hardest, pair.standing, pair.seen))
        return tuple(sorted(found, key=lambda contact: contact.first.time))


def energy_until(
    time: float,
    works: Array,
    energies: tuple[Array, Array],
    thrown: Body | None,
    objects: tuple[str, ...],
) -> Energy:
    """Work from t = 0 until a time, and kinetic energy then.

    Args:
        time: s.
        works: (3,) work until then, as the columns of `World.works`.
        energies: `World.energies` at t = 0 and at that time.
        thrown: What counts as thrown; None for nothing.
        objects: Names of the moving objects; only one that is thrown counts.
    """
    before, after = energies
    blocks = len(after) - len(objects)
    counted = np.arange(len(after)) < blocks
    index = blocks + objects.index(thrown) if isinstance(thrown, str) else thrown
    if index is not None:
        counted[index] = True
    kinetic = after[:, 0] - before[:, 0]
    own = 0.0 if index is None else float(kinetic[index])
    springs, motors, air = works.tolist()
    return Energy(
        time=time,
        springs=springs,
        motors=motors,
        gravity=float((before[:, 1] - after[:, 1])[counted].sum()),
        thrown=own,
        machine=float(kinetic[counted].sum()) - own,
        air=air,
    )
