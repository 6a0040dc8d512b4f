"""Setting poses and velocities of bodies: at the start, and when they are rebuilt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agentflow.env.physics.frames import swap, swap_quaternion
from agentflow.env.physics.model import Assembly
from agentflow.env.physics.pybullet.bodies import Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.readings import joint_motion, relative_motion
from agentflow.env.physics.rows import POSITION, ROTATION, SPIN, VELOCITY
from agentflow.env.rollout import Array
from agentflow.env.scene import Start
from agentflow.machine.geometry.vectors import add, rotate_vector


def place_at_start(client: int, built: Sequence[Built], start: Start) -> None:
    """Move newly built bodies from the ground to the start of the scene."""
    if start == Start():
        return
    rotation = start.rotation
    for uid in (body.uid for body in built):
        position, _ = pybullet.getBasePositionAndOrientation(uid, client)
        place = add(rotate_vector(rotation, swap(position)), (0.0, start.height, 0.0))
        pybullet.resetBasePositionAndOrientation(
            uid, swap(place), swap_quaternion(rotation), client
        )


def restore(
    client: int,
    built: Built,
    assembly: Assembly,
    rows: Array,
    motions: Mapping[int, tuple[float, float]],
) -> None:
    """Give a rebuilt body the positions and velocities of its parts, whose `rows` are (P, 13).

    `motions` are position and velocity of the joints that were in trees or parallel to those, by
    joint.
    """
    uid, root = built.uid, rows[built.piece.root]
    pybullet.resetBasePositionAndOrientation(
        uid, root[POSITION].tolist(), root[ROTATION].tolist(), client
    )
    pybullet.resetBaseVelocity(uid, root[VELOCITY].tolist(), root[SPIN].tolist(), client)
    for link, index in built.joints:
        joint = assembly.joints[link.joint]
        if link.rigid:
            continue
        if joint.kind == "spherical":
            rotation, spin = relative_motion(rows[link.parent], rows[link.part])
            pybullet.resetJointStateMultiDof(uid, index, rotation, spin, physicsClientId=client)
        elif joint.kind != "fixed":
            known = motions.get(link.joint)
            position, velocity = known or joint_motion(joint, assembly.parts, rows)
            pybullet.resetJointState(uid, index, position, velocity, physicsClientId=client)
