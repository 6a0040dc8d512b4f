"""When a machine has settled: tells rest from the slow beginning of a fall."""

from __future__ import annotations

import numpy as np

from agentflow.env.constants import Constants
from agentflow.env.physics.engine import World
from agentflow.env.rollout import Array
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

INTERVALS, MORE = 3, 10
"""How many intervals in a row have to be free of growing motion; more for what goes far in one,
as it may be swinging out in one way while it begins to tip in another."""


class Settling:
    """Watches a machine with power off, step by step.

    What stands on the point of tipping over is slow as well, but an inverted pendulum leaves its
    place exponentially: each interval carries it further than the one before. What rests, creeps
    on its contacts, sags or rolls out gains little or nothing, so the ways that each block has
    made in the last intervals tell the two apart, however slow both are. A boulder that rolls
    about in its container is held and does not count.
    """

    def __init__(self, machine: Machine, world: World, rate: float, physics: Constants) -> None:
        """Begin before the first step.

        Args:
            machine: What stands there.
            world: Where it stands.
            rate: Steps per second.
            physics: How much further an interval may carry.
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
            slow: Whether nothing was faster in it than what rests.

        Returns:
            Whether everything has been slow for an interval, and nothing gains.
        """
        self._steps += 1
        self._slow = self._slow + 1 if slow else 0
        if self._steps % self._interval:
            return False
        self._places.append(self._world.centres()[self._free])
        del self._places[: -MORE - 1]
        if self._slow < self._interval or len(self._places) <= INTERVALS:
            return False
        ways = self._ways()
        count = MORE if (ways[-1] > self._far).any() else INTERVALS
        before, after = ways[-count:][:-1], ways[-count:][1:]
        gaining = after > np.maximum(before * self._growth, before + self._gain)
        return len(ways) >= count and not gaining.any()

    def _ways(self) -> Array:
        """(T, N) metres that each block has gone in each of the last intervals."""
        moved = np.diff(np.array(self._places), axis=0)
        square = moved * moved
        return np.asarray(np.sqrt(square[:, :, 0] + square[:, :, 1] + square[:, :, 2]))
