"""Motors and dry friction of MuJoCo joints.

MuJoCo's velocity servos chatter or sag. Its dry friction is exact: a constraint that aims at speed
0 with a limited torque. A motor is dry friction that aims at another speed, which no interface of
MuJoCo sets. So the wanted acceleration of its row among the constraints is changed between the two
halves of a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from agentflow.env.physics.laws.forces import Entry, Indices
from agentflow.env.physics.model import Joint
from agentflow.env.physics.mujoco.bodies import CompiledModel, JointAddress
from agentflow.env.physics.mujoco.couplings import TIGHT
from agentflow.env.physics.structure.drives import HOLD, STILL, JointDrive, idle, merge_drives
from agentflow.env.rollout import Array

TOGETHER = 256
"""Steps whose work is computed at once."""
Ends = tuple[Array, Array]
"""The same before and after each step."""


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
        self.row = _indices([row for row, _, _ in self._joints])
        """Of each motor, among the rows of dry friction."""
        self._velocity = _indices([address.velocity for _, address, _ in self._joints])
        count = len(self._joints)
        first = int(self.row[0]) if count else 0
        self._together = self.row.tolist() == [*range(first, first + count)]
        """Whether their rows follow one another, so that a slice of all rows is theirs."""
        self._mixed = [i for i, (_, _, drive) in enumerate(self._joints) if drive.mixed]
        self._alike = [
            (drive.motors[0].speed, drive.motors[0].starts) for *_, drive in self._joints
        ]
        """Speed at level 1 and entry of each; of mixed ones, `mix` sets what they aim at."""
        self.mixed = bool(self._mixed)
        """Whether joints have motors that aim at different speeds."""
        self._aims = [0.0] * count
        """Speed that each motor aims at, rad/s."""
        self.changes: Array = np.zeros(count)
        """What is added to the wanted acceleration of each motor's row, rad/s2."""
        self._equalities, self._rows = 0, self.row
        """Rows of equalities in the last step, and each motor's among all, which follow them."""
        self.held: list[tuple[int, int, int, bool]] = []
        """Motors that hold an angle: which, where MuJoCo stores position and velocity, and whether
        each takes a new angle once it is overcome. Before any device is on, it comes back however
        far it is turned, as by the jerk when a boulder falls in."""
        self.angles = [0.0] * count
        """The angle that each motor holds, rad."""
        sliding = [
            (built.joints[link.joint], merge_drives(joints, link).stiffness)
            for link in built.links
            if link.joint in built.joints and joints[link.joint].kind == "prismatic"
        ]
        self._sliding = _indices([address.position for address, _ in sliding])
        self._stiffness = np.array([stiffness for _, stiffness in sliding])
        """Of each suspension, N/m."""
        self._simple = not (self._mixed or sliding)
        self._before: tuple[Array, ...] = ()
        """Speeds of all joints before the last step, with those that differ or slide also what is
        exerted besides and the positions."""
        self._noted: list[tuple[float, int, Array, tuple[Array, ...]]] = []
        """Of each step, its length, the number of rows of equalities, what each constraint exerted,
        and the motion before it."""
        self._taken: list[tuple[float, Array, Array, Array]] = []
        """What `catch_up` got before these steps."""
        self._works: list[Array] = []
        """Results for earlier steps."""

    def set(self) -> None:
        """Aim at the speeds that the levels give, and hold the angle where that is 0."""
        levels = self._levels
        aims = self._aims = [speed * levels.get(starts, 0.0) for speed, starts in self._alike]
        if 0.0 in aims:
            self._hold()
        else:
            self.held = []
        if self._mixed:
            self.mix()
        if aims:
            per = self.step * TIGHT
            self.changes[:] = [aim / per for aim in self._aims]

    def _hold(self) -> None:
        """Let motors that aim at 0 hold their angle."""
        before = {i for i, *_ in self.held}
        off = idle(self._levels)
        self.held = []
        for i, aim in enumerate(self._aims):
            if aim or i in self._mixed:
                continue
            _, address, _ = self._joints[i]
            if i not in before:
                self.angles[i] = float(self._qpos[address.position])
            still = abs(float(self._qvel[address.velocity])) <= STILL
            yields = not (off and still)
            self.held.append((i, address.position, address.velocity, yields))

    def mix(self) -> None:
        """Set joints whose motors aim at different speeds; before the first half of a step."""
        for i in self._mixed:
            _, address, drive = self._joints[i]
            command = drive.command(self._levels, float(self._qvel[address.velocity]))
            self._aims[i] = command.target
            self._aim(i, command.target)
            self._model.dof_frictionloss[address.velocity] = command.limit
            self._data.qfrc_applied[address.velocity] = command.push

    def drive(self) -> None:
        """Drive the joints for one step, between the two halves of it."""
        self._before = self._motion()
        if not self._joints:
            return
        data, angles = self._data, self.angles
        if self.held:  # on plain floats: machines have few motors
            position, velocity = self._qpos.tolist(), self._qvel.tolist()
            for i, at, speed, yields in self.held:
                angle = position[at]
                if yields and abs(velocity[speed]) > STILL:
                    angles[i] = angle
                self._aim(i, HOLD * (angles[i] - angle))
        if data.ne != self._equalities:
            self._equalities = data.ne
            self._rows = self.row + self._equalities
        if self._together:
            first = self._rows.item(0)
            own = data.efc_aref[first : first + len(self._joints)]
            np.add(own, self.changes, own)
        else:
            data.efc_aref[self._rows] += self.changes

    def _motion(self) -> tuple[Array, ...]:
        """What work is computed from: speeds; forces besides, and positions."""
        if self._simple:
            return (self._qvel.copy(),)
        return self._qvel.copy(), self._data.qfrc_applied.copy(), self._qpos.copy()

    def note(self, efforts: Array) -> None:
        """Note what all constraints exerted in the step, after its second half."""
        self._noted.append((self.step, self._equalities, efforts, self._before))
        if len(self._noted) == TOGETHER:
            self._add_works(self._motion())

    def catch_up(self, step: float, torques: Array, speeds: Array, places: Array) -> None:
        """Note steps of this length, s, with the (S, M) torque of each motor in them and, before
        each and after the last, the speeds and positions of all joints."""
        if self._noted:
            self._add_works((speeds[0], None, places[0]))
        self._taken.append((step, torques, speeds, places))

    def take_works(self) -> Array:
        """(S, 2) work of suspensions and of motors in each step since the last call, J."""
        self._add_works(self._motion())
        works, self._works = self._works, []
        return np.concatenate([np.zeros((0, 2)), *works])

    def _add_works(self, after: tuple[Any, ...]) -> None:
        """Compute the work in all steps that were noted, at once; `after` is the motion after
        the last of them."""
        (taken, noted), self._taken, self._noted = (self._taken, self._noted), [], []
        if taken:
            steps, turned, speed, place = zip(*taken, strict=True)
            each = np.repeat(steps, [len(some) for some in turned])
            self._works.append(self._work(each, np.concatenate(turned), _ends(speed), _ends(place)))
        if not noted:
            return
        lengths, equalities, efforts, before = zip(*noted, strict=True)
        torques, places = np.zeros((len(noted), 0)), np.zeros(0)
        if self._joints:
            ends = np.cumsum([len(each) for each in efforts])
            starts = np.concatenate([[0], ends[:-1]]) + equalities
            torques = np.concatenate(efforts)[starts[:, None] + self.row]
            if self._mixed:
                torques += np.array([each[1] for each in before])[:, self._velocity]
        if len(self._sliding):
            places = np.array([*(each[2] for each in before), after[2]])
        speeds = np.array([*(each[0] for each in before), after[0]])
        work = self._work(np.array(lengths), torques, _ends([speeds]), _ends([places]))
        self._works.append(work)

    def _work(self, lengths: Array, torques: Array, speeds: Ends, places: Ends) -> Array:
        """(S, 2) work of suspensions and of motors in steps of these lengths, J."""
        works = np.zeros((len(torques), 2))
        if self._joints:
            before, after = (each[:, self._velocity] for each in speeds)
            twice = np.multiply(torques, before + after, order="C")  # sums depend on the order
            works[:, 1] = twice.sum(axis=1) / 2 * lengths
        if len(self._sliding):
            before, after = (
                (self._stiffness * each[:, self._sliding] ** 2).sum(axis=1) for each in places
            )
            works[:, 0] = -(after - before) / 2
        return works

    def _aim(self, motor: int, speed: float) -> None:
        self.changes[motor] = speed / (self.step * TIGHT)


def _ends(stretches: Sequence[Array]) -> Ends:
    """The values before and after each step, from (S + 1, ...) values at the ends of steps."""
    before = np.concatenate([each[:-1] for each in stretches])
    return before, np.concatenate([each[1:] for each in stretches])


def _indices(numbers: Sequence[int]) -> Indices:
    return np.array(numbers, dtype=np.intp)
