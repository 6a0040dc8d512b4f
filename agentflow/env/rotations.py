"""Owns quaternion arithmetic on arrays: x, y, z, w; the formulas hold in either handedness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agentflow.env.trace import Array


def rotate(rotation: Array, vector: Sequence[float] | Array) -> Array:
    """Turn one vector, or (..., 3) vectors, by (..., 4) quaternions."""
    axis, w = rotation[..., :3], rotation[..., 3:]
    given = np.broadcast_to(np.asarray(vector, dtype=np.float64), axis.shape)
    twice = 2.0 * _cross(axis, given)
    return given + w * twice + _cross(axis, twice)


def inverse(rotation: Array) -> Array:
    """The rotation back, of unit quaternions (..., 4)."""
    turned: Array = rotation * np.array([-1.0, -1.0, -1.0, 1.0])
    return turned


def chain(second: Array, first: Array) -> Array:
    """First `first`, then `second`; both (..., 4)."""
    a, w = second[..., :3], second[..., 3:]
    b, v = first[..., :3], first[..., 3:]
    axis = w * b + v * a + _cross(a, b)
    return np.concatenate([axis, w * v - np.sum(a * b, axis=-1, keepdims=True)], axis=-1)


def _cross(a: Array, b: Array) -> Array:
    """`np.cross`, which spends several times as long on small arrays."""
    (x, y, z), (u, v, w) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    crossed: Array = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)
    return crossed
