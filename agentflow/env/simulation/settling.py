"""When a machine has settled: tells rest from the slow beginning of a fall."""

from __future__ import annotations

import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import World
from agentflow.env.rollout import Array
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

INTERVALS, MORE = 3, 10
"""How many successive intervals must show no growing motion. More for blocks that move far in one
interval: they may be swinging out in one direction while starting to tip in another."""


class Settling:
    """Watches a machine with power off, step by step.

    A machine that is about to tip over is slow as well, but like an inverted pendulum it moves
    exponentially: further in each interval than in the one before. A machine that rests, creeps on
    its contacts, sags or rolls out gains little or nothing. So the distances that each block moved
    in the last intervals tell the two apart, however slow both are. A boulder that rolls about in
    its container does not count.
    """

    def __init__(self, machine: Machine, world: World, rate: float, physics: Constants) -> None:
        """Begin before the first step.

        Args:
            machine: The machine.
            world: The world that it is in.
            rate: Steps per second.
            physics: Limits of growth from one interval to the next.
        """
        self._world = world
        self._far = physics["rest_drift"]
        self._gain, self._growth = physics["rest_gain"], 1.0 + physics["rest_growth"]
        self._interval = 2 * max(1, round(physics["rest_interval"] * rate / 2))
        """Steps; even, as resting contacts alternate between two states."""
        self._free = [
            step.id
            for step in machine
            if library()[step.type].joint.kind != "loose"
            or machine[step.parent].type not in library().containers
        ]
        self._steps = self._slow = 0
        self._places: list[Array] = []

    def step(self, slow: bool) -> bool:
        """Take in one step.

        Args:
            slow: Whether everything was slow enough to count as resting.

        Returns:
            Whether everything has been slow for an interval and no motion is growing.
        """
        self._steps += 1
        self._slow = self._slow + 1 if slow else 0
        if self._steps % self._interval:
            return False
        self._places.append(self._world.centres()[self._free])
        del self._places[: -MORE - 1]
        if self._slow < self._interval or len(self._places) <= INTERVALS:
            return False
        distances = self._distances()
        count = MORE if (distances[-1] > self._far).any() else INTERVALS
        before, after = distances[-count:][:-1], distances[-count:][1:]
        gaining = after > np.maximum(before * self._growth, before + self._gain)
        return len(distances) >= count and not gaining.any()

    def _distances(self) -> Array:
        """(T, N) metres that each block moved in each of the last intervals."""
        moved = np.diff(np.array(self._places), axis=0)
        square = moved * moved
        return np.asarray(np.sqrt(square[:, :, 0] + square[:, :, 1] + square[:, :, 2]))
