"""Owns the reading of what joints bear and how they stand, from PyBullet.

What the loads do to the connections is loads.py's.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from operator import itemgetter
from struct import Struct

import numpy as np

from agentflow.env.physics.pybullet.layout import Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.rollout import Array

_FORCES = itemgetter(2)
"""Force and torque in what PyBullet tells of a joint."""


class Sensors:
    """The joints of the trees that stand."""

    def __init__(self, client: int, built: Sequence[Built], count: int) -> None:
        """Set up.

        Args:
            client: PyBullet client.
            built: All bodies.
            count: Number of joints, in trees or not.
        """
        self._client = client
        self._bodies: list[tuple[int, list[int]]] = []
        self._joints: list[int] = []
        turned = []
        for body in built:
            links = sorted(body.body.links, key=lambda link: link.joint)
            if links:
                self._bodies.append((body.uid, [body.index[link.part] for link in links]))
            self._joints += [link.joint for link in links]
            turned += [link.reversed for link in links]
        in_order = self._joints == list(range(count))
        self._order = None if in_order else np.array(self._joints, dtype=np.intp)
        self._room = np.zeros((len(self._joints), 6))
        self._pack = Struct(f"{self._room.size}d").pack_into
        """Twice as fast as anything that makes an array of numbers."""
        self._turned = np.flatnonzero(turned)
        self.bodies = tuple(uid for uid, _ in self._bodies)
        """Those that have joints."""

    def read(self, reactions: Array) -> None:
        """Write what each joint of the trees bears into its row of (J, 6)."""
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
        into = reactions if self._order is None else self._room
        self._pack(into.data, 0, *chain.from_iterable(map(_FORCES, states)))
        if len(self._turned):
            into[self._turned] *= -1.0
        if self._order is not None:
            reactions[self._order] = into

    def motions(self) -> dict[int, tuple[float, float]]:
        """Position and velocity of every joint with one degree of freedom."""
        states = [
            state[:2]
            for uid, links in self._bodies
            for state in pybullet.getJointStates(uid, links, self._client)
        ]
        return dict(zip(self._joints, states, strict=True))
