"""Owns what joints are set to when a body is rebuilt in mid-motion, from the rows of its parts.

Rows as in kinematics.py, in a right-handed frame with z up; setting joints is the engine's.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2

import numpy as np

from agentflow.env.engines.base import Joint, Part
from agentflow.env.engines.frames import swap, swap_turn
from agentflow.env.engines.kinematics import (
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
from agentflow.env.engines.vectors import dot, subtract
from agentflow.env.scene import Quat, Vec3
from agentflow.env.trace import Array


def relative(parent: Array, child: Array) -> tuple[Quat, Vec3]:
    """Orientation and spin of a child row against its parent's, in the joint's frame."""
    turned = compose(conjugate(parent[None, ROTATION]), child[None, ROTATION])
    spin = turn_back(matrices(child[None, ROTATION]), (child[SPIN] - parent[SPIN])[None])
    x, y, z, w = turned[0].tolist()
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
