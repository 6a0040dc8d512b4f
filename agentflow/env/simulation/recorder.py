"""Recording a rollout: samples become a trace, and a trace becomes a digest."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agentflow.env.physics.engine import World
from agentflow.env.physics.model import Assembly
from agentflow.env.rollout import Array, Broken, Flags, Trace

LATER = ("pull", "work")
"""Fields of a trace that digests leave out: recorded runs hold digests from before they came."""
MOST_FINE = 26
"""Most fine samples of a rollout, as many as a window of 5 s has regular ones."""


class FineInterval(NamedTuple):
    """Times between which fine samples are kept, s, and what they are around."""

    first: float
    last: float
    event: float

    @classmethod
    def around(cls, event: float, before: float, after: float) -> FineInterval:
        """The interval around an event."""
        return cls(event - before - 1e-9, event + after + 1e-9, event)


class Recorder:
    """Collects the samples of one rollout."""

    def __init__(
        self, world: World, assembly: Assembly, connections: Sequence[int], objects: tuple[str, ...]
    ):
        """Start an empty record; `connections` are the indices of the breakable joints."""
        self._world, self._assembly = world, assembly
        self._pairs = tuple(
            (assembly.joints[i].block, assembly.joints[i].partner) for i in connections
        )
        self._connections = connections
        self.objects = objects
        self.times: list[float] = []
        self._regular: list[bool] = []
        self._snapshots: list[object] = []
        self._lost: dict[int, float] = {}
        """Time at which each joint was lost, s."""

    def lose(self, joint: int, time: float) -> None:
        """Record that a connection was lost; samples from that time on are without it."""
        self._lost[joint] = time

    def sample(self, time: float, regular: bool = True) -> None:
        """Take a sample: a regular one, or a fine one, of which only those near events are kept."""
        if self.times and self.times[-1] == time:
            self._regular[-1] |= regular
            return
        self.times.append(time)
        self._regular.append(regular)
        self._snapshots.append(self._world.snapshot())

    def snapshot_near(self, time: float) -> tuple[float, object]:
        """Time and snapshot of the sample closest to a time, s."""
        last = self.times[-1]
        index = int(np.abs(np.array(self.times) - min(time, last)).argmin())
        return self.times[index], self._snapshots[index]

    def trace(
        self, loads: Callable[[Array], Array], pulls: Mapping[int, tuple[Array, Array]]
    ) -> Trace:
        """The trace of all samples.

        Args:
            loads: Gives the greatest loads, (T, E), since the time before, of (T,) times.
            pulls: Pull and work of blocks in each sample.
        """
        times = np.array(self.times)
        states = self._world.states(self._snapshots)
        linear = tuple(block for block, _, _ in self._assembly.spans)
        pull, work = np.full((2, len(times), len(linear)), np.nan)
        for column, block in enumerate(linear):
            if block in pulls:
                pull[:, column], work[:, column] = pulls[block]
        return Trace(
            times=times,
            alive=self._alive(times),
            linear=linear,
            pull=pull,
            work=work,
            utilisation=self._utilisation(times, loads(times)),
            connections=self._pairs,
            objects=self.objects,
            regular=np.array(self._regular),
            **vars(states),
        )

    def _alive(self, times: Array) -> Flags:
        alive = np.ones((len(times), len(self._assembly.blocks)), dtype=bool)
        for index, time in self._lost.items():
            joint = self._assembly.joints[index]
            if not joint.extra:
                alive[times >= time, joint.block] = False
        return alive

    def _utilisation(self, times: Array, greatest: Array) -> Array:
        for column, joint in enumerate(self._connections):
            if joint in self._lost:
                greatest[times >= self._lost[joint], column] = np.nan
        return greatest


def thin_out(trace: Trace, events: Sequence[FineInterval]) -> Trace:
    """The regular samples of a trace, and at most `MOST_FINE` others, those near events.

    Args:
        trace: All samples.
        events: The most important first.
    """
    times, keep = trace.times, trace.regular.copy()
    left = MOST_FINE
    for first, last, event in events:
        found = np.flatnonzero((times >= first) & (times <= last) & ~keep)
        order = found[np.argsort(np.abs(times[found] - event), kind="stable")]
        keep[order[:left]] = True
        left -= min(left, len(order))
    starts = np.concatenate([[0], np.flatnonzero(keep)[:-1] + 1])
    return replace(trace[keep], utilisation=np.maximum.reduceat(trace.utilisation, starts))


def digest(trace: Trace, broken: Sequence[Broken]) -> str:
    """Hash of every recorded state and breakage: equal only for bitwise equal rollouts."""
    content = hashlib.sha256()
    for name, value in vars(trace).items():
        if isinstance(value, np.ndarray) and name not in LATER:
            content.update(np.ascontiguousarray(value).tobytes())
    content.update(repr(tuple(broken)).encode())
    return content.hexdigest()[:32]
