"""Owns what connections bear: the filtered loads, their share of the strength, what gives way.

Measuring reactions and splitting bodies is the engine's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agentflow.env.engines.base import Joint
from agentflow.env.trace import Array


class Loads:
    """Low-pass filtered load of every joint, from 0 at the start.

    Impacts last one step, so their unfiltered forces grow with the step rate; a window of some
    hundredths of a second makes them comparable (spec 2.3). E connections: the breakable joints.
    """

    def __init__(self, joints: Sequence[Joint], window: float, step: float) -> None:
        """Start with nothing loaded.

        Args:
            joints: All joints, as the engine numbers them.
            window: Time constant of the filter, s.
            step: Time between readings, s.
        """
        self._blend = step / (step + window)
        self._level = np.zeros((len(joints), 6))
        strength = [
            (joint.strength.force, joint.strength.torque) if joint.strength else (np.inf, np.inf)
            for joint in joints
        ]
        self._weakness = 1.0 / np.square(np.array(strength).reshape(-1, 2))
        self._share = np.zeros(len(joints))
        self._broken = np.zeros(len(joints), dtype=bool)
        self.connections = [i for i, joint in enumerate(joints) if joint.strength]
        """Joint index of each connection."""

    def update(self, reactions: Array) -> list[int]:
        """Take in one step's (J, 6) reactions; the joints that give way now, ascending."""
        self._level += self._blend * (reactions - self._level)
        square = (self._level * self._level).reshape(-1, 2, 3)
        parts = (square[:, :, 0] + square[:, :, 1] + square[:, :, 2]) * self._weakness
        self._share = np.maximum(parts[:, 0], parts[:, 1])
        if not self._share.max(initial=0.0) >= 1.0:
            return []
        gone = np.flatnonzero((self._share >= 1.0) & ~self._broken)
        self._broken[gone] = True
        return [int(i) for i in gone]

    def share(self, joint: int) -> float:
        """Load over strength of a joint; 1 breaks."""
        return float(np.sqrt(self._share[joint]))

    def forget(self, joint: int) -> None:
        """A joint is gone: it bears nothing."""
        self._level[joint] = 0.0

    def utilisation(self) -> Array:
        """(E,) load over strength of each connection; nan where it broke."""
        share: Array = np.sqrt(self._share[self.connections])
        share[self._broken[self.connections]] = np.nan
        return share
