"""A wall across the road, somewhere ahead, before which the machine must stop."""

import random

import numpy as np

from agentflow.env.feedback.text import number
from agentflow.env.rollout import Trace, Verdict
from agentflow.env.rotations import compose, conjugate, matrices
from agentflow.env.scene import SceneObject, blocks_among
from agentflow.env.tasks.base import Parameters, WorldView
from agentflow.env.tasks.family import wall
from agentflow.env.tasks.knobs import knob
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import subtract
from agentflow.machine.tree import Machine

NAME = "wall ahead"
TOLERANCE = 0.3
"""How far from the wanted gap a machine may stop, m."""
REST = 0.2
"""Speed of the root below which it has stopped, m/s."""


class Stop(Parameters):
    """Where to stop."""

    gap: float = knob(0, 0, 10, "m", "gap to a wall ahead, at which to stop; 0: there is no wall")
    nearest: float = knob(20, 10, 100, "m", "least z of the wall's near face")
    farthest: float = knob(40, 10, 200, "m", "greatest z of the wall's near face")

    @property
    def middle(self) -> float:
        """z of the wall's near face in a level without a trial, m."""
        return (self.nearest + self.farthest) / 2

    def draw(self, rng: random.Random) -> float:
        """z of the wall's near face in a trial, m."""
        return round(rng.uniform(self.nearest, self.farthest), 3)

    def objects(self, wall_at: float, width: float) -> tuple[SceneObject, ...]:
        """The wall with its near face at a z, across a road of this width, m."""
        return (wall(NAME, 0.0, wall_at + 0.5, (width, 3.0, 1.0)),) if self.gap else ()


class StopReferee:
    """Watches for touches of the wall, and where the machine stops."""

    def __init__(self, machine: Machine, stop: Stop, wall_at: float) -> None:
        self._stop, self._place = stop, wall_at
        blocks = place(machine).blocks
        self._halves = np.array([subtract(block.box_max, block.box_min) for block in blocks]) / 2
        self._rest = np.array([block.quaternion for block in blocks])
        self._touched: float | None = None

    def start(self, world: WorldView) -> None:
        """Nothing counts before t = 0."""

    def watch(self, world: WorldView) -> bool:
        """Look for touches; one ends the trial."""
        if self._touched is None and blocks_among(world.touching(NAME)):
            self._touched = world.time
        return self._touched is not None

    def verdict(self, trace: Trace) -> Verdict:
        """Score 1 or 0 and terms: success, outcome, and by how much it missed the gap, m."""
        turned = matrices(compose(trace.rotation[-1], conjugate(self._rest)))
        reach = (np.abs(turned[:, 2]) * self._halves).sum(axis=1)
        gap = self._place - float((trace.centre[-1, :, 2] + reach).max())
        speed = float((trace.velocity[-1, 0] ** 2).sum() ** 0.5)
        miss = max(0.0, abs(gap - self._stop.gap) - TOLERANCE)
        success = self._touched is None and not miss and speed < REST
        outcome = f"stopped {number(gap)} m before the wall"
        if self._touched is not None:
            outcome = f"touched the wall at {number(self._touched)} s"
        elif speed >= REST:
            outcome = f"{number(gap)} m before the wall, still at {number(speed)} m/s"
        terms: dict[str, float | bool | str | None] = {
            "success": success,
            "outcome": outcome,
            "miss": miss or None,
            "gap": gap,
            "wall": self._place,
        }
        return Verdict(float(success), terms)
