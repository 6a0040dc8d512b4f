"""What is held where it is until it is let go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.laws.forces import Entry, PartForce, PartLocations, part_motion
from agentflow.env.physics.rows import Row
from agentflow.machine.geometry.vectors import Vec3, add, scale, subtract

HOLDS = "holds"
STIFF = 20.0
"""Angular frequency of the springs that hold, rad/s; they are critically damped."""


class HoldForce:
    """Carries the weight of parts and objects, each by a spring from its centre to where that was
    at first, until the entry `holds` is at 1. It outlives splits."""

    def __init__(self, masses: Mapping[int, float], gravity: float, levels: Mapping[Entry, float]):
        """Hold parts, and objects numbered on from the last part, of these masses (kg)."""
        self._masses, self._levels = masses, levels
        self._lift = (0.0, 0.0, gravity)
        self._locations: PartLocations
        self._places: dict[int, Vec3] = {}

    def locate(self, locations: PartLocations) -> HoldForce:
        """Read rows by these locations of parts and objects from now on."""
        self._locations = locations
        return self

    def __call__(self, rows: Sequence[Row]) -> list[PartForce]:
        """The forces in this step."""
        if self._levels.get(HOLDS, 0.0) >= 1.0:
            return []
        forces: list[PartForce] = []
        for part, mass in self._masses.items():
            row, offset = self._locations.locate(part)
            place, velocity = part_motion(rows[row], offset)
            away = subtract(self._places.setdefault(part, place), place)
            pull = subtract(scale(away, STIFF**2), scale(velocity, 2 * STIFF))
            forces.append((part, scale(add(self._lift, pull), mass), place))
        return forces
