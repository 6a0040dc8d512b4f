"""Quaternions (x, y, z, w) and rotation matrices as arrays, in any frame; and how far recorded
joints are turned.

Only elementwise operations in a fixed order, no BLAS and no long reductions, so that the bits do
not depend on the processor. `machine.geometry.vectors` does the same with tuples.
"""

from collections.abc import Sequence

import numpy as np

from agentflow.env.rollout import Array, Trace
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import Quat
from agentflow.machine.tree import Machine

# Entries of a rotation matrix from doubled products of quaternion components (x y z w, 4 i + j):
# 1 at the diagonal, plus sign * product, twice.
_ONES = np.array([1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0])
_FIRST = np.array([5, 1, 2, 1, 0, 6, 2, 6, 0])
_FIRST_SIGN = np.array([-1.0, 1, 1, 1, -1.0, 1, 1, 1, -1.0])
_SECOND = np.array([10, 11, 7, 11, 10, 3, 7, 3, 5])
_SECOND_SIGN = np.array([-1.0, -1, 1, 1, -1, -1, -1, 1, -1])
# The two axes that follow each of x, y, z in a cross product.
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def matrices(quaternions: Array) -> Array:
    """(C, 3, 3) rotation matrices of (C, 4) unit quaternions."""
    products = (2.0 * quaternions[:, :, None] * quaternions[:, None, :]).reshape(-1, 16)
    first, second = products.take(_FIRST, 1), products.take(_SECOND, 1)
    flat = _ONES + first * _FIRST_SIGN + second * _SECOND_SIGN
    return np.asarray(flat).reshape(-1, 3, 3)


def turn(rotation: Array, vectors: Array) -> Array:
    """(C, 3) vectors turned by (C, 3, 3) matrices."""
    terms = rotation * vectors[:, None, :]
    return np.asarray(terms[:, :, 0] + terms[:, :, 1] + terms[:, :, 2])


def turn_back(rotation: Array, vectors: Array) -> Array:
    """(C, 3) vectors turned by the inverse of (C, 3, 3) matrices."""
    terms = rotation * vectors[:, :, None]
    return np.asarray(terms[:, 0] + terms[:, 1] + terms[:, 2])


def cross(a: Array, b: Array) -> Array:
    """Row-wise right-handed cross product of (..., 3) arrays."""
    after, before = a.take(_NEXT, -1) * b.take(_LAST, -1), a.take(_LAST, -1) * b.take(_NEXT, -1)
    return np.asarray(after - before)


def compose(first: Array, second: Array) -> Array:
    """Hamilton product of (..., 4) quaternions: `second`'s rotation, then `first`'s."""
    ax, ay, az, aw = first[..., 0], first[..., 1], first[..., 2], first[..., 3]
    bx, by, bz, bw = second[..., 0], second[..., 1], second[..., 2], second[..., 3]
    product: Array = np.empty(np.broadcast_shapes(first.shape, second.shape))
    product[..., 0] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    product[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return product


def conjugate(quaternions: Array) -> Array:
    """Inverse rotations of (..., 4) unit quaternions."""
    return np.asarray(quaternions * np.array([-1.0, -1.0, -1.0, 1.0]))


def rotate(rotation: Array, vector: Sequence[float] | Array) -> Array:
    """One vector, or (..., 3) vectors, rotated by (..., 4) quaternions."""
    axis, w = rotation[..., :3], rotation[..., 3:]
    given = np.broadcast_to(np.asarray(vector, dtype=np.float64), axis.shape)
    twice = 2.0 * cross(axis, given)
    rotated: Array = given + w * twice + cross(axis, twice)
    return rotated


def rotated_axes(rotation: Quat) -> Array:
    """(3, 3) axes x, y and z after a rotation, one in each row: `v @ rotated_axes(q)` rotates v."""
    return np.asarray(matrices(np.array([rotation]))[0].T)


def turns(machine: Machine, block: int) -> bool:
    """Whether a block turns on its parent about one axis."""
    return machine[block].parent >= 0 and library()[machine[block].type].joint.kind == "revolute"


def joint_speed(machine: Machine, trace: Trace, block: int) -> Array:
    """(T,) angular velocity of a block against its parent, rad/s, about its joint's axis."""
    axis = rotate(trace.rotation[:, block], _axis(machine, block))
    relative = trace.angular_velocity[:, block] - trace.angular_velocity[:, machine[block].parent]
    speed: Array = (relative * axis).sum(axis=1)
    return speed


def joint_angle(machine: Machine, trace: Trace, block: int) -> Array:
    """(T,) angle of a block against its parent, rad, about its joint's axis, from 0 as built.

    It counts whole turns: the speeds say how many there were between two samples.
    """
    built = place(machine).blocks
    own, parent = (np.array(built[i].quaternion) for i in (block, machine[block].parent))
    rest = compose(conjugate(parent), own)
    now = compose(conjugate(trace.rotation[:, machine[block].parent]), trace.rotation[:, block])
    turn = compose(conjugate(rest), now)
    about = turn[:, :3] @ _axis(machine, block)
    angle = _within_half_turn(2.0 * np.arctan2(about, turn[:, 3]))
    speed = joint_speed(machine, trace, block)
    expected = (speed[1:] + speed[:-1]) / 2 * np.diff(trace.times)
    steps = expected + _within_half_turn(np.diff(angle) - expected)
    return np.concatenate([angle[:1], angle[0] + np.cumsum(steps)])


def _axis(machine: Machine, block: int) -> Array:
    """The joint's axis in the block's own frame."""
    return np.array(DIRECTIONS[library()[machine[block].type].joint.axis], dtype=float)


def _within_half_turn(angle: Array) -> Array:
    """The same angles between -pi and pi."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def unify_signs(rotation: Array) -> Array:
    """Flip the signs of (T, ..., 4) quaternions so that neighbours in time interpolate the short
    way."""
    same = np.sum(rotation[1:] * rotation[:-1], axis=-1, keepdims=True) >= 0
    flips = np.concatenate([np.ones((1, *same.shape[1:])), np.where(same, 1.0, -1.0)])
    steady: Array = rotation * np.cumprod(flips, axis=0)
    return steady
