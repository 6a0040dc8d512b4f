"""Reading MuJoCo: rows of clusters and things, reactions, motions and powers of joints."""

from __future__ import annotations

import numpy as np

from agentflow.env.physics.frames import WRENCH_ORDER, WRENCH_SIGNS
from agentflow.env.physics.model import Joint
from agentflow.env.physics.mujoco.bodies import Built
from agentflow.env.physics.rows import WIDTH, Row
from agentflow.env.physics.structure.spanning_tree import Link
from agentflow.env.rollout import Array

ROW_ORDER = np.array([0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 11, 12])
"""Where each number of a row is among MuJoCo's, whose quaternions begin with w."""


class Rows:
    """The rows of one layout after the last step."""

    def __init__(self, built: Built) -> None:
        numbers = 6 * len(built.links)
        self._source = built.data.sensordata[numbers:].reshape(-1, WIDTH)
        self._list: list[Row] = []
        self.table: Array = self._source.take(ROW_ORDER, axis=1)
        """(C, 13) every row; a new array after each step."""

    def read(self) -> None:
        """Read the rows after a step."""
        self.table = self._source.take(ROW_ORDER, axis=1)
        self._list = []

    @property
    def all(self) -> list[Row]:
        """Every row as numbers."""
        if not self._list:
            self._list = list(map(tuple, self.table.tolist()))
        return self._list


class Reactions:
    """What each joint of the trees bears, from a force and a torque sensor at each part's pivot.

    The sensors give all that the parent exerts on the part, along free axes too. That is what
    motors, springs, friction and stops exert there, which is left out of the reaction except where
    the joint stands for others parallel to it.
    """

    def __init__(self, built: Built, joints: tuple[Joint, ...]) -> None:
        self._sensed = built.data.sensordata
        self._source = np.zeros((len(joints), 6), dtype=np.intp)
        """Where among the sensors each number of the reactions is."""
        self._share = np.zeros((len(joints), 6))
        """What it is multiplied with; 0 for joints in no tree."""
        self._oblique: list[tuple[int, Array]] = []
        """Joints whose free axis is none of the coordinate axes, and that axis (6,)."""
        for row, link in enumerate(built.links):
            sign = -1.0 if link.reversed else 1.0
            self._source[link.joint] = 6 * row + WRENCH_ORDER
            self._share[link.joint] = sign * WRENCH_SIGNS * self._borne(joints[link.joint], link)

    def _borne(self, joint: Joint, link: Link) -> Array:
        """(6,) 1 for what counts as borne, 0 along coordinate axes that are free."""
        borne = np.ones(6)
        if joint.kind == "fixed" or link.rigid or link.parallel:
            return borne
        if joint.kind == "spherical":
            borne[3:] = 0.0
            return borne
        axis = np.zeros(6)
        axis[:3] = joint.axis if joint.kind == "prismatic" else 0.0
        axis[3:] = joint.axis if joint.kind == "revolute" else 0.0
        if np.count_nonzero(axis) == 1:
            borne[axis != 0.0] = 0.0
        else:
            self._oblique.append((link.joint, axis))
        return borne

    def read(self, reactions: Array) -> None:
        """Write the reactions of all joints, (J, 6), game frame; 0 for joints in no tree."""
        self._sensed.take(self._source, out=reactions, mode="clip")  # "raise" would copy
        np.multiply(reactions, self._share, out=reactions)
        for joint, axis in self._oblique:
            reactions[joint] -= np.add.reduce(reactions[joint] * axis) * axis


def motions(built: Built) -> dict[int, tuple[float, float]]:
    """Position and velocity of every joint in the trees that has one degree of freedom, and of
    those parallel to it."""
    position, velocity = built.data.qpos, built.data.qvel
    found = {}
    for link in built.links:
        place = built.joints.get(link.joint)
        if place is not None:
            at, speed = float(position[place.position]), float(velocity[place.velocity])
            found[link.joint] = at, speed
            for other in link.parallel:
                found[other.joint] = other.sign * at, other.sign * speed
    return found
