"""Reading MuJoCo: rows of clusters and objects, reactions and motions of joints, contacts."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from agentflow.env.physics.engine import Touch
from agentflow.env.physics.frames import WRENCH_ORDER, WRENCH_SIGNS
from agentflow.env.physics.model import Joint
from agentflow.env.physics.mujoco.bodies import CompiledModel
from agentflow.env.physics.rows import WIDTH, Row, top_speeds
from agentflow.env.physics.structure.drives import joint_motions
from agentflow.env.physics.structure.spanning_tree import Link
from agentflow.env.physics.world import pair_up, sum_touches
from agentflow.env.rollout import Array
from agentflow.env.scene import Body

ROW_ORDER = np.array([0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 11, 12])
"""Where each number of a row is among MuJoCo's, whose quaternions begin with w."""
_ORDER, _SIGNS = WRENCH_ORDER.tolist(), WRENCH_SIGNS.tolist()

Found = tuple[Any, Array, Array]
"""Of C contacts: (C, 2) shapes, (C,) normal forces (N) and (C, 3) places."""
NONE: Any = np.zeros((0, 9), np.int32)
"""No contacts, as MuJoCo stores them."""
Kept = tuple[Found, Any, int]
"""Contacts in several steps, where those of each step begin, and the number of a step."""


class Rows:
    """The rows of one layout after the last step."""

    def __init__(self, built: CompiledModel) -> None:
        numbers = 6 * len(built.links)
        self._source = built.data.sensordata[numbers:].reshape(-1, WIDTH)
        self.read()

    def read(self) -> None:
        """Read the rows after a step."""
        self.table: Array = self._source.take(ROW_ORDER, axis=1)
        """(C, 13) every row; a new array after each step."""
        self.known: list[Row] = []
        """Every row as numbers, if `all` was asked for."""
        self.speeds: tuple[float, float] | None = None
        self.air: float | None = None
        """What is known already of these rows: `top_speeds`, and power of drag, W."""

    def __getitem__(self, row: int) -> Row:
        """One row."""
        if self.known:
            return self.known[row]
        found: Row = self.table[row].tolist()
        return found

    @property
    def all(self) -> list[Row]:
        """Every row as numbers."""
        if not self.known:
            self.known = self.table.tolist()
        return self.known

    @property
    def top_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed, m/s and rad/s."""
        if self.speeds is None:
            self.speeds = top_speeds(self.all)
        return self.speeds


class Reactions:
    """What each joint of the trees bears, from a force and a torque sensor at each part's pivot.

    The sensors give all that the parent exerts on the part, along free axes too. That is what
    motors, springs, friction and stops exert there, which is left out of the reaction except where
    the joint stands for others parallel to it.
    """

    def __init__(self, built: CompiledModel, joints: tuple[Joint, ...]) -> None:
        self._sensed = built.data.sensordata
        source, share = ([[0] * 6] * len(joints) for _ in range(2))
        self._oblique: list[tuple[int, Array]] = []
        """Joints whose free axis is none of the coordinate axes, and that axis (6,)."""
        for row, link in enumerate(built.links):
            sign, borne = -1.0 if link.reversed else 1.0, self._borne(joints[link.joint], link)
            source[link.joint] = [6 * row + i for i in _ORDER]
            share[link.joint] = [sign * one * some for one, some in zip(_SIGNS, borne, strict=True)]
        self.source = np.array(source, dtype=np.intp).reshape(-1, 6)
        """Where among the sensors each number of the reactions is."""
        self.share: Array = np.array(share, dtype=np.float64).reshape(-1, 6)
        """What it is multiplied with; 0 for joints in no tree."""

    def _borne(self, joint: Joint, link: Link) -> Sequence[float]:
        """Six numbers: 1 for what counts as borne, 0 along coordinate axes that are free."""
        if joint.kind == "fixed" or link.rigid or link.parallel:
            return (1.0,) * 6
        if joint.kind == "spherical":
            return (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
        x, y, z = joint.axis
        axis = (x, y, z, 0.0, 0.0, 0.0) if joint.kind == "prismatic" else (0.0, 0.0, 0.0, x, y, z)
        if sum(map(bool, axis)) == 1:
            return [0.0 if along else 1.0 for along in axis]
        self._oblique.append((link.joint, np.array(axis)))
        return (1.0,) * 6

    @property
    def plain(self) -> bool:
        """Whether there is nothing to `correct`."""
        return not self._oblique

    def read(self, reactions: Array) -> None:
        """Write the reactions of all joints, (J, 6), game frame; 0 for joints in no tree."""
        self._sensed.take(self.source, out=reactions, mode="clip")  # "raise" would copy
        np.multiply(reactions, self.share, out=reactions)
        self.correct(reactions[None])

    def correct(self, reactions: Array) -> None:
        """Leave out what (S, J, 6) readings have along oblique free axes."""
        for joint, axis in self._oblique:
            for one in reactions[:, joint]:
                one -= np.add.reduce(one * axis) * axis


def motions(built: CompiledModel) -> dict[int, tuple[float, float]]:
    """Position and velocity of every joint in the trees that has one degree of freedom, and of
    those parallel to it."""
    position, velocity = built.data.qpos, built.data.qvel
    moving = [link for link in built.links if link.joint in built.joints]
    places = [built.joints[link.joint] for link in moving]
    at = [(float(position[own.position]), float(velocity[own.velocity])) for own in places]
    return joint_motions(zip(moving, at, strict=True))


class Contacts:
    """What touched what in the last step; nothing before the first."""

    def __init__(self, built: CompiledModel) -> None:
        self._data, self._owners = built.data, built.owners
        self._most = built.model.narena
        self._memory: Any = None
        """All contacts that MuJoCo has room for, as it stores them, as 4-byte words in rows; None
        until there are any."""
        self._stored = (slice(0),) * 3
        """Where place, two shapes and row of a contact are among these words."""
        self._words, self._efforts = NONE, np.zeros(0)
        """Of the last step, if it was taken singly: contacts, and what each constraint exerted."""
        self.kept: Kept | None = None
        """Where the contacts of the last step are, if several were taken at once."""
        self._pair = cache(lambda shapes: pair_up(*(built.owners[each] for each in shapes)))
        """The owners of two shapes: sorting them takes longer than to find them again."""
        self._shapes: dict[Body, set[int]] = {}
        """Of each body that was asked about."""

    def read(self, efforts: Array) -> None:
        """Read the contacts of a step, before the first half of the next one replaces them.

        Args:
            efforts: What each constraint exerted in the step.
        """
        count = self._data.ncon
        if count and self._memory is None:
            self._locate(self._data.contact)
        self._words = self._memory[:count].copy() if count else NONE
        self._efforts, self.kept = efforts, None

    def _look(self) -> Found:
        """The contacts; of a step that was taken singly with rows for forces, and words."""
        if self.kept:
            (shapes, normal, places), counts, i = self.kept
            first, last = counts.item(i), counts.item(i + 1)
            return shapes[first:last], normal[first:last], places[first:last]
        place, geoms, row = self._stored
        return self._words[:, geoms], self._words[:, row], self._words[:, place]

    def _locate(self, contact: Any) -> None:
        """Find where MuJoCo stores contacts: always in the same place, one after another. Copying
        them as they are takes a third of the time of asking for some of their fields."""
        start, (size,) = address_of(contact.dist), contact.dist.strides
        place, geoms, row = (
            slice((address_of(field) - start) // 4, (address_of(field) - start + length) // 4)
            for field, length in ((contact.pos, 24), (contact.geom, 8), (contact.efc_address, 4))
        )
        self._stored = place, geoms, row
        room = ctypes.c_char * (self._most // size * size)
        memory = np.frombuffer(room.from_address(start), np.int32)
        self._memory = memory.reshape(-1, size // 4)

    def touching(self, body: Body) -> frozenset[Body]:
        """What a block or object was in contact with."""
        owners = self._owners
        if body not in self._shapes:
            self._shapes[body] = {i for i, owner in enumerate(owners) if owner == body}
        mine, found = self._shapes[body], set()
        for one, other in self._look()[0].tolist():
            if one in mine:
                found.add(owners[other])
            elif other in mine:
                found.add(owners[one])
        return frozenset(found - {body})

    def all(self) -> list[Touch]:
        """Everything that was in contact."""
        shapes, normal, places = self._look()
        if not self.kept:
            normal = np.append(self._efforts, 0.0)[normal.ravel()]  # without force: row -1
            places = places.copy().view(np.float64).reshape(-1, 3)
        pairs = map(self._pair, map(tuple, shapes.tolist()))
        return sum_touches(zip(pairs, normal.tolist(), places.tolist(), strict=True))


def address_of(array: Array) -> int:
    """Where the first number of an array is in memory."""
    address: int = array.__array_interface__["data"][0]
    return address
