"""Recording a rollout: samples become a trace, and a trace becomes a digest."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from agentflow.env.physics.model import Assembly, Joint, State
from agentflow.env.rollout import Array, Broken, Trace


class Recorder:
    """Collects the samples of one rollout."""

    def __init__(self, assembly: Assembly, connections: Sequence[int], things: tuple[str, ...]):
        """Start an empty record; `connections` are the indices of the breakable joints."""
        self._assembly = assembly
        self._pairs = tuple(
            (assembly.joints[i].block, assembly.joints[i].partner) for i in connections
        )
        self._things = things
        self._times: list[float] = []
        self._shares: list[Array] = []
        self._alive = np.ones(len(assembly.blocks), dtype=bool)
        self._lives: list[np.ndarray[tuple[int], np.dtype[np.bool_]]] = []

    def lose(self, joint: Joint) -> None:
        """Record that a connection was lost: its block no longer holds on to its parent."""
        if not joint.extra:
            self._alive[joint.block] = False

    def sample(self, time: float, utilisation: Array) -> None:
        """Add one sample; the world keeps the positions."""
        self._times.append(time)
        self._shares.append(utilisation)
        self._lives.append(self._alive.copy())

    def trace(self, states: State) -> Trace:
        """The trace of all samples, at least one; `states` has a leading axis of times."""
        return Trace(
            times=np.array(self._times),
            alive=np.stack(self._lives),
            linear=tuple(block for block, _, _ in self._assembly.spans),
            utilisation=np.stack(self._shares),
            connections=self._pairs,
            things=self._things,
            **vars(states),
        )


def digest(trace: Trace, broken: Sequence[Broken]) -> str:
    """Hash of every recorded state and breakage: equal only for bitwise equal rollouts."""
    content = hashlib.sha256()
    for value in vars(trace).values():
        if isinstance(value, np.ndarray):
            content.update(np.ascontiguousarray(value).tobytes())
    content.update(repr(tuple(broken)).encode())
    return content.hexdigest()[:32]
