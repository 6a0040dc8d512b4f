"""Motors, dry friction and suspensions of PyBullet joints.

Bullet stores impulses per step, so everything is set again when the step length changes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.model import Drive, Joint
from agentflow.env.physics.pybullet.bodies import Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.machine.geometry.vectors import IDENTITY

Handled = tuple[int, int, Drive]
"""Body number, link number and drive of the joint."""


class Motors:
    """Drives of all joints: motors, dry friction, spring-dampers."""

    def __init__(
        self,
        client: int,
        levels: Mapping[str, float],
        built: Sequence[Built],
        joints: Sequence[Joint],
    ) -> None:
        """Set every motor; `levels` of schedule entries are read whenever motors are set."""
        self._client, self._levels = client, levels
        found: dict[str, list[Handled]] = {"revolute": [], "prismatic": [], "spherical": []}
        for body in built:
            for link in body.piece.links:
                joint = joints[link.joint]
                if joint.kind in found:
                    found[joint.kind].append((body.uid, body.index[link.part], joint.drive))
        self._sliding = found["prismatic"]
        self._single = [*found["revolute"], *self._sliding]
        self._balls = found["spherical"]
        self.set()

    def are_started_by(self, entry: str) -> bool:
        """Whether a schedule entry starts any motor."""
        return any(drive.torque and drive.starts == entry for _, _, drive in self._single)

    def set(self) -> None:
        """Set every motor; joints without one turn freely except for their friction."""
        client = self._client
        for uid, index, drive in self._single:
            pybullet.setJointMotorControl2(
                uid,
                index,
                pybullet.VELOCITY_CONTROL,
                targetVelocity=drive.speed * self._levels.get(drive.starts, 0.0),
                force=drive.torque or drive.friction,
                physicsClientId=client,
            )
        for uid, index, drive in self._balls:
            pybullet.setJointMotorControlMultiDof(
                uid,
                index,
                pybullet.POSITION_CONTROL,
                targetPosition=IDENTITY,
                targetVelocity=(0.0, 0.0, 0.0),
                positionGain=0.0,
                velocityGain=1.0,
                force=(drive.friction,) * 3,
                physicsClientId=client,
            )

    def set_suspensions(self) -> None:
        """Apply the suspensions for one step. The dampers are brakes of limited force, which cannot
        make light blocks oscillate."""
        client = self._client
        for uid, index, drive in self._sliding:
            position, velocity = pybullet.getJointState(uid, index, client)[:2]
            pybullet.setJointMotorControl2(
                uid,
                index,
                pybullet.VELOCITY_CONTROL,
                targetVelocity=0.0,
                force=drive.damping * abs(velocity),
                physicsClientId=client,
            )
            pybullet.setJointMotorControl2(
                uid,
                index,
                pybullet.TORQUE_CONTROL,
                force=-drive.stiffness * position,
                physicsClientId=client,
            )
