"""The work of forces that change little from step to step: of thrusters, blades, wind and drag."""

from __future__ import annotations

import numpy as np

from agentflow.env.physics.laws.select import Forces, Power
from agentflow.env.rollout import Array

SELDOM = 4
"""Steps between readings of the power: reading it in every step would take as long as the forces
themselves."""


class Ledger:
    """Adds up the work of such forces from readings of their power; it outlives splits."""

    def __init__(self) -> None:
        """Start with no work done."""
        self._steps, self._due = 0, SELDOM
        """Steps noted so far, and how many they are at the next reading."""
        self._since = 0.0
        """Time since the last reading, s."""
        self._power: Power | None = None
        """What was read last; None if the forces have changed abruptly since."""
        self._read = [(0.0, 0.0, 0.0)]
        """Of each reading, the steps until then, and the work of thrusters and of the air, J."""

    def add(self, forces: Forces, step: float) -> None:
        """Note that a step of this length, s, was taken with these forces."""
        self._steps += 1
        self._since += step
        if self._steps >= self._due:
            self._add_reading(forces)

    def interrupt(self, forces: Forces) -> None:
        """Note that something is switched or splits: from now on, the power may be another."""
        if self._since:
            self._add_reading(forces)
        self._power, self._due = None, self._steps + 1

    def works(self, forces: Forces) -> Array:
        """(2, S + 1) work of thrusters and of the air until the end of each step, J."""
        if self._since:
            self._add_reading(forces)
        steps, *works = np.array(self._read).T
        return np.array([np.interp(np.arange(self._steps + 1), steps, work) for work in works])

    def _add_reading(self, forces: Forces) -> None:
        power = forces.power()
        before, (_, thrust, air) = self._power or power, self._read[-1]
        thrust += self._since * (before.thrust + power.thrust) / 2
        air += self._since * (before.air + power.air) / 2
        self._read.append((self._steps, thrust, air))
        self._power, self._since, self._due = power, 0.0, self._steps + SELDOM
