"""Detecting that a machine has settled, as opposed to slowly starting to fall."""

from __future__ import annotations

import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import World
from agentflow.env.rollout import Array
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

INTERVALS, MORE = 3, 10
"""Number of successive intervals without growing motion. More are needed if a block moves far in
one interval: it may be swinging to a stop in one direction while starting to tip in another."""


class Settling:
    """Watches a machine with power off, step by step, at `rate` steps per second.

    A machine that is about to tip over is slow as well, but like an inverted pendulum it moves
    exponentially: further in each interval than in the one before. A machine that rests, creeps on
    its contacts, sags or rolls to a stop speeds up little or not at all. So the distances that each
    block moved in the last intervals distinguish the two at any speed. Boulders that roll about in
    a container are ignored.
    """

    def __init__(self, machine: Machine, world: World, rate: float, physics: Constants) -> None:
        self._world = world
        self._far = physics["rest_drift"]
        self._gain, self._growth = physics["rest_gain"], 1.0 + physics["rest_growth"]
        self.interval = 2 * max(1, round(physics["rest_interval"] * rate / 2))
        """Steps between looks; even, as resting contacts alternate between two states."""
        self._free = [
            step.id
            for step in machine
            if library()[step.type].joint.kind != "loose"
            or machine[step.parent].type not in library().containers
        ]
        self._steps = self._slow = 0
        self._places: list[Array] = []

    def step(self, slow: bool) -> bool:
        """Register one step.

        Args:
            slow: Whether everything was slow enough to count as resting.

        Returns:
            Whether everything has been slow for an interval and no motion is growing.
        """
        self._steps += 1
        self._slow = self._slow + 1 if slow else 0
        if self._steps % self.interval:
            return False
        self._places.append(self._world.centres()[self._free])
        del self._places[: -MORE - 1]
        if self._slow < self.interval or len(self._places) <= INTERVALS:
            return False
        moved = np.diff(np.array(self._places), axis=0)
        square = moved * moved
        distances = np.sqrt(square[:, :, 0] + square[:, :, 1] + square[:, :, 2])
        count = MORE if (distances[-1] > self._far).any() else INTERVALS
        before, after = distances[-count:][:-1], distances[-count:][1:]
        gaining = after > np.maximum(before * self._growth, before + self._gain)
        return len(distances) >= count and not gaining.any()
