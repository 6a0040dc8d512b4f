"""Motors and dry friction of MuJoCo joints.

MuJoCo's velocity servos chatter or sag. Its dry friction is exact: a constraint that aims at speed
0 with a limited torque. A motor is dry friction that aims at another speed, which no interface of
MuJoCo sets. So the wanted acceleration of its row among the constraints is changed between the two
halves of a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from agentflow.env.physics.laws.forces import Entry, Indices
from agentflow.env.physics.model import Joint
from agentflow.env.physics.mujoco.bodies import CompiledModel, JointAddress
from agentflow.env.physics.mujoco.couplings import TIGHT
from agentflow.env.physics.structure.drives import HOLD, STILL, JointDrive, idle, merge_drives
from agentflow.env.rollout import Array


class Motors:
    """The drives of all joints that turn about or slide along one axis."""

    def __init__(
        self,
        levels: Mapping[Entry, float],
        built: CompiledModel,
        joints: Sequence[Joint],
        step: float,
    ) -> None:
        """Find the rows of all motors; call `set` before the first step.

        Args:
            levels: Of entries; read whenever motors are set.
            built: The model.
            joints: All joints of the assembly.
            step: Length of a step, s.
        """
        self._model, self._data, self._levels = built.model, built.data, levels
        self._qpos, self._qvel = built.data.qpos, built.data.qvel
        self.step = step
        """Length of a step, s."""
        rubbing = np.flatnonzero(built.model.dof_frictionloss > 0.0)
        rows = {int(freedom): row for row, freedom in enumerate(rubbing)}
        self._joints: list[tuple[int, JointAddress, JointDrive]] = []
        """Row among those of dry friction, address and drive of each joint with a motor."""
        for link in built.links:
            address = built.joints.get(link.joint)
            if address is None or joints[link.joint].kind == "spherical":
                continue
            drive = merge_drives(joints, link)
            if drive.turns:
                self._joints.append((rows[address.velocity], address, drive))
        self._row = _indices([row for row, _, _ in self._joints])
        self._position = _indices([address.position for _, address, _ in self._joints])
        self._velocity = _indices([address.velocity for _, address, _ in self._joints])
        self._mixed = [i for i, (_, _, drive) in enumerate(self._joints) if drive.mixed]
        self._aims: Array = np.zeros(len(self._joints))
        """Speed that each motor aims at, rad/s."""
        self._changes: Array = np.zeros(len(self._joints))
        """What is added to the wanted acceleration of each motor's row, rad/s2."""
        self._equalities, self._rows = 0, self._row
        """Rows of equalities in the last step, and each motor's among all, which follow them."""
        self._held = _indices([])
        """Motors that hold an angle."""
        self._yields = np.ones(0, dtype=bool)
        """Whether each of these takes a new angle once it is overcome. Before any device is on, it
        comes back however far it is turned, as by the jerk when a boulder falls in."""
        self._angles: Array = np.zeros(len(self._joints))
        """The angle that each motor holds, rad."""
        self._before = self._torques = np.zeros(len(self._joints))
        """Speeds before the last step, and torques in it."""

    def set(self) -> None:
        """Aim at the speeds that the levels give, and hold the angle where that is 0."""
        for i, (_, _, drive) in enumerate(self._joints):
            self._aims[i] = drive.command(self._levels).target
        held = [
            i
            for i, (_, _, drive) in enumerate(self._joints)
            if not drive.mixed and not self._aims[i]
        ]
        new = _indices(sorted(set(held).difference(self._held.tolist())))
        self._angles[new] = self._qpos[self._position[new]]
        self._held = _indices(held)
        still = np.abs(self._qvel[self._velocity[self._held]]) <= STILL
        self._yields = ~still if idle(self._levels) else np.ones(len(held), dtype=bool)
        self.mix()
        self._aim()

    def mix(self) -> None:
        """Set joints whose motors aim at different speeds; before the first half of a step."""
        for i in self._mixed:
            _, address, drive = self._joints[i]
            command = drive.command(self._levels, float(self._qvel[address.velocity]))
            self._aims[i] = command.target
            self._model.dof_frictionloss[address.velocity] = command.limit
            self._data.qfrc_applied[address.velocity] = command.push

    def drive(self) -> None:
        """Drive the joints for one step, between the two halves of it."""
        if not self._joints:
            return
        data = self._data
        if len(self._held):
            held = self._held
            angle, speed = self._qpos[self._position[held]], self._qvel[self._velocity[held]]
            slips = self._yields & (np.abs(speed) > STILL)
            self._angles[held] = np.where(slips, angle, self._angles[held])
            self._aims[held] = HOLD * (self._angles[held] - angle)
        if len(self._held) or self._mixed:
            self._aim()
        if data.ne != self._equalities:
            self._equalities = data.ne
            self._rows = self._row + self._equalities
        data.efc_aref[self._rows] += self._changes
        self._before = self._qvel.take(self._velocity)

    def read(self) -> None:
        """Read the torques of the step, after its second half."""
        if self._joints:
            self._torques = self._data.efc_force.take(self._rows)

    def power(self) -> float:
        """Mean power of the motors in the last step, W."""
        speeds = (self._before + self._qvel[self._velocity]) / 2
        return float((self._torques * speeds).sum())

    def _aim(self) -> None:
        self._changes = self._aims / (self.step * TIGHT)


def _indices(numbers: Sequence[int]) -> Indices:
    return np.array(numbers, dtype=np.intp)
