"""Owns quaternion arithmetic on arrays: x, y, z, w; the formulas hold in either handedness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agentflow.env.rollout import Array
from agentflow.env.scene import Quat


def rotate(rotation: Array, vector: Sequence[float] | Array) -> Array:
    """Turn one vector, or (..., 3) vectors, by (..., 4) quaternions."""
    axis, w = rotation[..., :3], rotation[..., 3:]
    given = np.broadcast_to(np.asarray(vector, dtype=np.float64), axis.shape)
    twice = 2.0 * np.cross(axis, given)
    turned: Array = given + w * twice + np.cross(axis, twice)
    return turned


def inverse(rotation: Array) -> Array:
    """The rotation back, of unit quaternions (..., 4)."""
    turned: Array = rotation * np.array([-1.0, -1.0, -1.0, 1.0])
    return turned


def chain(second: Array, first: Array) -> Array:
    """First `first`, then `second`; both (..., 4)."""
    a, w = second[..., :3], second[..., 3:]
    b, v = first[..., :3], first[..., 3:]
    axis = w * b + v * a + np.cross(a, b)
    return np.concatenate([axis, w * v - np.sum(a * b, axis=-1, keepdims=True)], axis=-1)


def frame_of(rotation: Quat) -> Array:
    """(3, 3) axes x, y and z after a rotation, one in each row: `v @ frame_of(q)` turns v."""
    x, y, z, w = rotation
    return np.array(
        [
            (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)),
            (2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)),
            (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)),
        ]
    )
