"""Owns what connections bear: the filtered loads, their share of the strength, what gives way.

Measuring reactions and splitting bodies is the engine's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
        self._broken = np.zeros(len(joints), dtype=bool)
        self.connections = [i for i, joint in enumerate(joints) if joint.strength]
        """Joint index of each connection."""

    def update(self, reactions: Array, below: Sequence[int]) -> dict[int, float]:
        """Take in one step's loads.

        Where an impact overloads several joints in a row, the one furthest from the root gives
        way and relieves those below it: what hung there no longer pulls at them, so this step
        counts nothing for them.

        Args:
            reactions: (J, 6) force and torque through each joint.
            below: (J,) the next joint towards the root; -1 where there is none.

        Returns:
            The joints that give way with their load over strength, the most loaded first.
        """
        before = self._level
        self._level = before + self._blend * (reactions - before)
        ratios = self._ratios()
        if not ratios.max(initial=0.0) >= 1.0:
            return {}
        share = np.sqrt(np.maximum(ratios[:, 0], ratios[:, 1]))
        over = [int(i) for i in np.flatnonzero(share >= 1.0)]
        relieved = {joint for start in over for joint in _path(start, below)}
        for joint in relieved:
            self._level[joint] = before[joint]
        gone = sorted(set(over) - relieved, key=lambda joint: (-share[joint], joint))
        self._level[gone] = 0.0
        self._broken[gone] = True
        return {joint: float(share[joint]) for joint in gone}

    def _ratios(self) -> Array:
        """(J, 2) squares of force and of torque over strength."""
        square = (self._level * self._level).reshape(-1, 2, 3)
        return np.asarray((square[:, :, 0] + square[:, :, 1] + square[:, :, 2]) * self._weakness)

    def utilisation(self) -> Array:
        """(E,) load over strength of each connection; nan where it broke."""
        ratios = self._ratios()[self.connections]
        share: Array = np.sqrt(np.maximum(ratios[:, 0], ratios[:, 1]))
        share[self._broken[self.connections]] = np.nan
        return share


def _path(joint: int, below: Sequence[int]) -> Iterator[int]:
    """All joints between a joint and the root of its body."""
    while (joint := below[joint]) >= 0:
        yield joint
