"""Reading PyBullet: rows of clusters and objects, reactions and motions of joints."""

from collections.abc import Mapping, Sequence
from struct import Struct
from typing import Any

import numpy as np

from agentflow.env.physics.frames import WRENCH_ORDER, WRENCH_SIGNS
from agentflow.env.physics.model import Joint
from agentflow.env.physics.pybullet.bodies import Built, Handle
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.rows import WIDTH, Row, top_speeds
from agentflow.env.physics.structure.drives import has_motor, joint_motions, merge_drives
from agentflow.env.physics.structure.spanning_tree import Link
from agentflow.env.rollout import Array


class Rows:
    """The rows of one layout: the heads, which lead a body, in every step, the others on demand."""

    def __init__(self, built: Built) -> None:
        """Read the heads."""
        self._client, layout = built.client, built.layout
        self._heads: list[tuple[int, int]] = []
        self._tails: list[tuple[slice, int, tuple[int, ...]]] = []
        row = 0
        leading = set(layout.leading)
        for body in built.pieces:
            links = tuple(
                body.index[link.part] for link in body.piece.links if link.part in leading
            )
            self._heads.append((row, body.uid))
            if links:
                self._tails.append((slice(row + 1, row + 1 + len(links)), body.uid, links))
            row += 1 + len(links)
        self._heads += [(i, built.objects[name]) for i, name in enumerate(layout.objects, row)]
        self._blank: list[Row] = [()] * layout.object_rows.stop
        self._partial = False
        self.known = self._blank
        """Rows read so far; empty tuples for the others."""
        self.heads = [row for row, _ in self._heads]
        """Rows of the bodies' roots and of moving objects."""
        self.read()

    def read(self) -> None:
        """Read the heads after a step, and forget the other rows."""
        client, rows = self._client, self._blank.copy()
        for row, uid in self._heads:
            position, rotation = pybullet.getBasePositionAndOrientation(uid, client)
            velocity, spin = pybullet.getBaseVelocity(uid, client)
            rows[row] = position + rotation + velocity + spin
        self.known = rows
        self._partial = bool(self._tails)

    def __getitem__(self, row: int) -> Row:
        """One row."""
        return self.known[row] or self.all[row]

    @property
    def all(self) -> list[Row]:
        """Every row; a new list in every step.

        Reading makes PyBullet update the positions of links, which pushing them requires.
        """
        if self._partial:
            for place, uid, links in self._tails:
                self.known[place] = [
                    state[0] + state[1] + state[6] + state[7]
                    for state in pybullet.getLinkStates(uid, links, 1, 1, self._client)
                ]
            self._partial = False
        return self.known

    @property
    def table(self) -> Array:
        """Every row, as an array (C, 13)."""
        return np.array(self.all).reshape(-1, WIDTH)

    @property
    def head_speeds(self) -> tuple[float, float]:
        """Greatest linear and angular speed of the heads, m/s and rad/s."""
        known = self.known
        return top_speeds([known[row] for row in self.heads])


class Sensors:
    """Sensors of the joints in the current trees."""

    def __init__(self, built: Built) -> None:
        """Plan the reading of all joints, in trees or not."""
        self._client, joints = built.client, built.assembly.joints
        self._bodies: list[tuple[int, list[int]]] = []
        links: list[Link] = []
        handles: list[Handle] = []
        for body in built.pieces:
            if body.joints:
                own = sorted(body.joints, key=lambda each: each[0].joint)
                self._bodies.append((body.uid, [index for _, index in own]))
                links += [link for link, _ in own]
                handles += [(body.uid, index) for _, index in own]
        self._links = links
        self._turning = [
            row
            for row, link in enumerate(links)
            if joints[link.joint].kind == "revolute" and not link.rigid
        ]
        self._before: Sequence[tuple[Any, ...]] = ()
        self._states: Sequence[tuple[Any, ...]] = ()
        """PyBullet's states of all joints before and after the last step."""
        self._motors = [
            (row, link.joint, _wrench_of_motor(joints[link.joint]))
            for row, link in enumerate(links)
            if link.parallel
        ]
        """Row, joint and wrench (6,) per unit of its motor of each joint that others are parallel
        to. PyBullet's sensors leave out what motors exert."""
        self._driven = [
            (row, handles[row]) for row in self._turning if has_motor(joints, links[row])
        ]
        self._sliding = [
            (row, merge_drives(joints, link).stiffness)
            for row, link in enumerate(links)
            if joints[link.joint].kind == "prismatic" and not link.rigid
        ]
        self._works: list[tuple[float, float]] = []
        """Work of suspensions and of motors in each step, J."""
        self._read = np.zeros(6 * len(links) + 1)
        """Force and torque of each joint from PyBullet, then a 0 for joints that are in no tree."""
        self._pack = Struct(f"{6 * len(links)}d").pack_into
        """Twice as fast as any conversion to an array."""
        self._source = np.full((len(joints), 6), 6 * len(links), dtype=np.intp)
        """Where in `_read` each number of the reactions is, and its sign."""
        self._sign = np.tile(WRENCH_SIGNS, (len(joints), 1))
        for row, link in enumerate(links):
            self._source[link.joint] = 6 * row + WRENCH_ORDER
            if link.reversed:
                self._sign[link.joint] *= -1.0

    def read(self, reactions: Array) -> None:
        """Write the reactions of all joints, (J, 6), game frame; 0 for joints in no tree."""
        states: list[tuple[Any, ...]] = []
        for uid, links in self._bodies:
            states += pybullet.getJointStates(uid, links, self._client)
        self._before, self._states = self._states, states
        numbers: list[float] = []
        for _, _, forces, _ in states:
            numbers += forces
        self._pack(self._read.data, 0, *numbers)
        self._read.take(self._source, out=reactions, mode="clip")  # "raise" would copy
        np.multiply(reactions, self._sign, out=reactions)
        for row, joint, wrench in self._motors:
            reactions[joint] += states[row][3] * wrench

    @property
    def spin(self) -> float:
        """Greatest speed of a turning joint in the last step, rad/s."""
        states = self._states
        return max([abs(states[row][1]) for row in self._turning], default=0.0)

    def add_work(self, step: float, pushes: Mapping[Handle, float]) -> None:
        """Add up the work in a step.

        Args:
            step: Its length, s.
            pushes: Torque besides that of the motor of some joints (`Motors.pushes`), N m.
        """
        now, before = self._states, self._before
        springs = motors = 0.0
        for i, handle in self._driven:
            torque = now[i][3] + pushes[handle] if handle in pushes else now[i][3]
            motors += (before[i][1] + now[i][1]) * torque
        for i, stiffness in self._sliding:
            springs += stiffness * (before[i][0] ** 2 - now[i][0] ** 2)
        self._works.append((springs / 2, motors * step / 2))

    def take_works(self) -> Array:
        """(S, 2) work of suspensions and of motors in each step since the last call, J."""
        works, self._works = self._works, []
        return np.array(works).reshape(-1, 2)

    def motions(self) -> dict[int, tuple[float, float]]:
        """Position and velocity of every joint in the trees that has one degree of freedom, and of
        those parallel to it."""
        states = [
            state[:2]
            for uid, links in self._bodies
            for state in pybullet.getJointStates(uid, links, self._client)
        ]
        found = zip(self._links, states, strict=True)
        return joint_motions((link, state) for link, state in found if not link.rigid)


def _wrench_of_motor(joint: Joint) -> Array:
    """(6,) what a motor of force or torque 1 exerts on part `b`, game frame."""
    wrench = np.zeros(6)
    if joint.kind == "prismatic":
        wrench[:3] = joint.axis
    elif joint.kind == "revolute":
        wrench[3:] = joint.axis
    return wrench
