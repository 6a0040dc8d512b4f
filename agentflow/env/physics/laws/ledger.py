"""The work of forces that change little from step to step: of thrusters, blades and drag."""

import numpy as np

from agentflow.env.physics.laws.air import GustClock
from agentflow.env.physics.laws.select import Forces, Power
from agentflow.env.rollout import Array

SELDOM = 8
"""Steps between readings of the power."""


class Ledger:
    """Adds up the work of such forces from readings of their power; it outlives splits."""

    def __init__(self, wind: GustClock) -> None:
        """Start with no work done; the wind adds up its own."""
        self._wind, self._blown = wind, [0.0]
        """Its work until each reading, J."""
        self.steps, self.time, self.due = 0, 0.0, SELDOM
        """Steps taken so far, how long they took (s), and how many they are at the next reading;
        the world counts them itself, as a call in every step takes longer."""
        self._at, self._times = [0], [0.0]
        """The same of each reading."""
        self._powers = [Power(0.0, 0.0)]
        """What was read each time."""

    def interrupt(self, forces: Forces) -> None:
        """Note that something is switched or splits: from now on, the power may be another."""
        if self._at[-1] != self.steps:
            self.read(forces)
        self.due = self.steps + 1

    def works(self, forces: Forces) -> Array:
        """(2, S + 1) work of thrusters and of the air until the end of each step, J."""
        self.interrupt(forces)
        powers = np.array(self._powers).T
        each = np.diff(self._times) * (powers[:, :-1] + powers[:, 1:]) / 2
        works = np.concatenate([np.zeros((2, 1)), each.cumsum(axis=1)], axis=1)
        works[1] += self._blown
        return np.array([np.interp(np.arange(self.steps + 1), self._at, work) for work in works])

    def read(self, forces: Forces) -> None:
        """Read the power in the last step."""
        self._at.append(self.steps)
        self._times.append(self.time)
        self._powers.append(forces.power())
        self._blown.append(self._wind.work)
        self.due = self.steps + SELDOM
