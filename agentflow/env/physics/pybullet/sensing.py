"""Reactions and motions of joints, read from PyBullet."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from operator import itemgetter
from struct import Struct

import numpy as np

from agentflow.env.physics.frames import WRENCH_ORDER, WRENCH_SIGNS
from agentflow.env.physics.pybullet.bodies import Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.spanning_tree import Link
from agentflow.env.rollout import Array

_FORCES = itemgetter(2)
"""Force and torque in PyBullet's state of a joint."""


class Sensors:
    """Sensors of the joints in the current trees."""

    def __init__(self, client: int, built: Sequence[Built], count: int) -> None:
        """Plan the reading of `count` joints, in trees or not."""
        self._client = client
        self._bodies: list[tuple[int, list[int]]] = []
        links: list[Link] = []
        for body in built:
            if body.piece.links:
                own = sorted(body.piece.links, key=lambda link: link.joint)
                self._bodies.append((body.uid, [body.index[link.part] for link in own]))
                links += own
        self._joints = [link.joint for link in links]
        self._read = np.zeros(6 * len(links) + 1)
        """Force and torque of each joint from PyBullet, then a 0 for joints that are in no tree."""
        self._pack = Struct(f"{6 * len(links)}d").pack_into
        """Twice as fast as anything that makes an array of numbers."""
        self._source = np.full((count, 6), 6 * len(links), dtype=np.intp)
        """Where in `_read` each number of the reactions is, and its sign."""
        self._sign = np.tile(WRENCH_SIGNS, (count, 1))
        for row, link in enumerate(links):
            self._source[link.joint] = 6 * row + WRENCH_ORDER
            if link.reversed:
                self._sign[link.joint] *= -1.0

    def read(self, reactions: Array) -> None:
        """Write the reactions of all joints, (J, 6), game frame; 0 for joints in no tree."""
        client = self._client
        if len(self._bodies) == 1:
            ((uid, links),) = self._bodies
            states = pybullet.getJointStates(uid, links, client)
        else:
            states = [
                state
                for uid, links in self._bodies
                for state in pybullet.getJointStates(uid, links, client)
            ]
        self._pack(self._read.data, 0, *chain.from_iterable(map(_FORCES, states)))
        self._read.take(self._source, out=reactions, mode="clip")  # "raise" would copy
        np.multiply(reactions, self._sign, out=reactions)

    def motions(self) -> dict[int, tuple[float, float]]:
        """Position and velocity of every joint with one degree of freedom."""
        states = [
            state[:2]
            for uid, links in self._bodies
            for state in pybullet.getJointStates(uid, links, self._client)
        ]
        return dict(zip(self._joints, states, strict=True))
