"""Motors, dry friction and suspensions of PyBullet joints.

Bullet stores impulses per step, so everything is set again when the step length changes.
"""

from collections.abc import Mapping
from functools import partial

from agentflow.env.physics.laws.forces import Entry
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.bodies import Built, Handle
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.structure.drives import (
    HOLD,
    STILL,
    JointDrive,
    has_motor,
    idle,
    merge_drives,
)
from agentflow.env.physics.structure.spanning_tree import Link, Skeleton
from agentflow.machine.geometry.vectors import IDENTITY, dot

SERIES_ITERATIONS = 6
"""Passes over motors and constraints in each of Bullet's iterations, where one is too few: this
times the square of the number of motors in series, as each passes torque on to the next. With
`solver_iterations` of 20, two to four rotating blocks in a row hold 460 N m and sink by 0.2 degrees
under it; with one pass the arm of two sinks by several degrees."""
LOOP_ITERATIONS = 5
"""The same in machines with loops: more would add up forces that a loop leaves undetermined."""

OBLIQUE = 0.5
"""Cosine of the angle between two axes below which their motors hardly act on each other."""

Handled = tuple[int, int, JointDrive]
"""Body number, link number and drive of the joint."""


class Motors:
    """Drives of all joints: motors, dry friction, spring-dampers."""

    def __init__(
        self, built: Built, levels: Mapping[Entry, float], step: float, series: bool
    ) -> None:
        """Set every motor.

        Args:
            built: The bodies.
            levels: Of entries; read whenever motors are set.
            step: See `step`.
            series: Whether motors are in series.
        """
        client, joints = built.client, built.assembly.joints
        self._client, self._levels, self._series = client, levels, series
        self._control = partial(pybullet.setJointMotorControl2, physicsClientId=client)
        self.step = step
        """Length of a step, s."""
        found: dict[str, list[Handled]] = {"revolute": [], "prismatic": [], "spherical": []}
        for body in built.pieces:
            for link, index in body.joints:
                kind = joints[link.joint].kind
                if kind in found and not link.rigid:
                    drive = merge_drives(joints, link)
                    found[kind].append((body.uid, index, drive))
        self._sliding = found["prismatic"]
        self._single = [*found["revolute"], *self._sliding]
        self._mixed = [handled for handled in self._single if handled[2].mixed]
        self._balls = found["spherical"]
        self.pushes: dict[Handle, float] = {}
        """Torque besides the motor's in the last step, of joints whose motors differ, N m."""
        self.set()

    def set(self) -> None:
        """Set every motor; joints without one turn freely except for their friction."""
        holding = self._series or idle(self._levels)
        for handled in self._single:
            self._set_single(*handled, holding)
        for uid, index, drive in self._balls:
            pybullet.setJointMotorControlMultiDof(
                uid,
                index,
                pybullet.POSITION_CONTROL,
                targetPosition=IDENTITY,
                targetVelocity=(0.0, 0.0, 0.0),
                positionGain=0.0,
                velocityGain=1.0,
                force=(drive.command(self._levels).limit,) * 3,
                physicsClientId=self._client,
            )

    def _set_single(self, uid: int, index: int, drive: JointDrive, holding: bool) -> None:
        """Set the motor of one joint.

        Motors that stand still hold their angle until a device is switched on, and at level 0
        later if motors are in series, which is `holding`. Others only aim at speed 0, and give way
        for good.
        """
        if holding and drive.turns and not drive.command(self._levels).target:
            angle, speed = pybullet.getJointState(uid, index, self._client)[:2]
            if abs(speed) <= STILL:
                self._hold(uid, index, drive, angle)
                return
        self._turn(uid, index, drive, 0.0)

    def _hold(self, uid: int, index: int, drive: JointDrive, angle: float) -> None:
        """Let a motor hold an angle with its torque."""
        self._control(
            uid,
            index,
            pybullet.POSITION_CONTROL,
            targetPosition=angle,
            targetVelocity=0.0,
            positionGain=HOLD * self.step,
            velocityGain=1.0,
            force=drive.command(self._levels).limit,
        )

    def _turn(self, uid: int, index: int, drive: JointDrive, speed: float) -> float:
        """Let the motor of a joint that has this speed aim at a speed; returns the torque to apply
        besides."""
        aim, limit, push = drive.command(self._levels, speed)
        self._control(uid, index, pybullet.VELOCITY_CONTROL, targetVelocity=aim, force=limit)
        return push

    def set_for_step(self) -> None:
        """Apply suspensions, and motors that differ, for one step. The dampers are brakes of
        limited force, which cannot make light blocks oscillate."""
        for uid, index, drive in self._mixed:
            speed = pybullet.getJointState(uid, index, self._client)[1]
            self.pushes[uid, index] = push = self._turn(uid, index, drive, speed)
            self._push(uid, index, push)
        for uid, index, drive in self._sliding:
            position, velocity = pybullet.getJointState(uid, index, self._client)[:2]
            brake = drive.damping * abs(velocity)
            self._control(uid, index, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=brake)
            self._push(uid, index, -drive.stiffness * position)

    def _push(self, uid: int, index: int, force: float) -> None:
        """Apply a force or torque along the axis of a joint for one step."""
        self._control(uid, index, pybullet.TORQUE_CONTROL, force=force)


def inner_iterations(series: int, plan: Skeleton) -> int:
    """How often Bullet must pass over motors and constraints in each iteration.

    It solves them one after another. That converges slowly where a light cluster passes the torque
    of one motor on to another, as between stacked rotating blocks, and in loops.
    """
    if series > 1:
        return SERIES_ITERATIONS * series**2
    return LOOP_ITERATIONS if plan.loops else 1


def longest_series(assembly: Assembly, plan: Skeleton) -> int:
    """The most motors of which each passes its torque on to the next: the cluster between them is
    lighter than what is on either side of it, and their axes are not at right angles."""
    joints, cluster = assembly.joints, plan.cluster
    beyond = [part.mass for part in assembly.parts]
    for piece in plan.pieces:
        for link in reversed(piece.links):
            beyond[link.parent] += beyond[link.part]
    own: dict[int, float] = {}
    for part, name in zip(assembly.parts, cluster, strict=True):
        own[name] = own.get(name, 0.0) + part.mass
    longest = 1
    for piece in plan.pieces:
        above: dict[int, tuple[Link, int]] = {}
        for link in piece.links:
            if joints[link.joint].kind == "fixed" or link.rigid or not has_motor(joints, link):
                continue
            near, before = above.get(cluster[link.parent], (None, 0))
            series = 1
            if near and abs(dot(joints[near.joint].axis, joints[link.joint].axis)) > OBLIQUE:
                between = own[cluster[link.parent]]
                rest = beyond[piece.root] - beyond[near.part]
                if between < min(beyond[link.part], rest):
                    series = before + 1
            above[cluster[link.part]] = link, series
            longest = max(longest, series)
    return longest
