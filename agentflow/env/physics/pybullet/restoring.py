"""Owns how bodies are put in place: where a scene starts, and in mid-motion when they are rebuilt.

Rows as in kinematics.py, in a right-handed frame with z up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2

import numpy as np

from agentflow.env.physics.frames import swap, swap_quaternion, swap_turn
from agentflow.env.physics.kinematics import (
    POSITION,
    ROTATION,
    SPIN,
    VELOCITY,
    carried,
    compose,
    conjugate,
    matrices,
    turn_back,
)
from agentflow.env.physics.model import Assembly, Joint, Part
from agentflow.env.physics.pybullet.layout import Built
from agentflow.env.physics.pybullet.library import pybullet
from agentflow.env.physics.vectors import add, dot, subtract, turned
from agentflow.env.rollout import Array
from agentflow.env.scene import Quat, Start, Vec3


def place_at_start(client: int, built: Sequence[Built], start: Start) -> None:
    """Turn and raise bodies that stand as they were made, on the ground at the world's middle."""
    if start == Start():
        return
    rotation = start.rotation
    for uid in (body.uid for body in built):
        position, _ = pybullet.getBasePositionAndOrientation(uid, client)
        place = add(turned(rotation, swap(position)), (0.0, start.height, 0.0))
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
    """Put a rebuilt body where its parts were, moving as they moved.

    Args:
        client: PyBullet client.
        built: The body.
        assembly: The machine.
        rows: (P, 13) of all parts.
        motions: Position and velocity of the joints that trees had, by joint.
    """
    uid, root = built.uid, rows[built.piece.root]
    pybullet.resetBasePositionAndOrientation(
        uid, root[POSITION].tolist(), root[ROTATION].tolist(), client
    )
    pybullet.resetBaseVelocity(uid, root[VELOCITY].tolist(), root[SPIN].tolist(), client)
    for link in built.piece.links:
        joint = assembly.joints[link.joint]
        index = built.index[link.part]
        if joint.kind == "spherical":
            rotation, spin = relative(rows[link.parent], rows[link.part])
            pybullet.resetJointStateMultiDof(uid, index, rotation, spin, physicsClientId=client)
        elif joint.kind != "fixed":
            position, velocity = motions.get(link.joint) or motion(joint, assembly.parts, rows)
            pybullet.resetJointState(uid, index, position, velocity, physicsClientId=client)


def relative(parent: Array, child: Array) -> tuple[Quat, Vec3]:
    """Orientation and spin of a child row against its parent's, in the joint's frame."""
    rotation = compose(conjugate(parent[None, ROTATION]), child[None, ROTATION])
    spin = turn_back(matrices(child[None, ROTATION]), (child[SPIN] - parent[SPIN])[None])
    x, y, z, w = rotation[0].tolist()
    p, q, r = spin[0].tolist()
    return (x, y, z, w), (p, q, r)


def motion(joint: Joint, parts: Sequence[Part], rows: Array) -> tuple[float, float]:
    """Position and velocity of a revolute or prismatic joint that no tree had: it closed a loop.

    Args:
        joint: The joint.
        parts: All parts.
        rows: (P, 13) of them.
    """
    if joint.kind == "revolute":
        axis = swap_turn(joint.axis)
        (x, y, z, w), spin = relative(rows[joint.a], rows[joint.b])
        return 2.0 * atan2(dot((x, y, z), axis), w), dot(spin, axis)
    ends = [
        carried(rows[None, i], np.array([swap(subtract(joint.pivot, parts[i].centre))]))
        for i in (joint.a, joint.b)
    ]
    base, apart = matrices(rows[None, joint.a, ROTATION]), ends[1] - ends[0]
    axis = swap(joint.axis)
    along = turn_back(base, apart[:, POSITION])[0].tolist()
    speed = turn_back(base, apart[:, VELOCITY])[0].tolist()
    return dot(along, axis), dot(speed, axis)
