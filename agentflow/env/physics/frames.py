"""Conversion between the game frame (left-handed, y up) and a right-handed frame with z up.

Vectors swap y and z. That is a reflection, so axes of rotation and quaternions also change sign.
"""

from collections.abc import Sequence

import numpy as np

from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import Quat, Vec3

WRENCH_ORDER = np.array([0, 2, 1, 3, 5, 4])
WRENCH_SIGNS = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
"""Force and torque (6,) change frame as `(wrench * WRENCH_SIGNS)[WRENCH_ORDER]`."""


def swap(vector: Sequence[float]) -> Vec3:
    """A position, displacement, velocity or force: (x, y, z) to (x, z, y). Its own inverse."""
    return (vector[0], vector[2], vector[1])


def swap_turn(vector: Sequence[float]) -> Vec3:
    """An axis, angular velocity or torque. Its own inverse."""
    return (-vector[0], -vector[2], -vector[1])


def swap_quaternion(quaternion: Sequence[float]) -> Quat:
    """An orientation x, y, z, w. Its own inverse."""
    x, y, z, w = quaternion
    return (-x, -z, -y, w)


def swap_all(vectors: Array) -> Array:
    """`swap` for an (..., 3) array."""
    return vectors[..., [0, 2, 1]]


def swap_turns(vectors: Array) -> Array:
    """`swap_turn` for an (..., 3) array."""
    return -vectors[..., [0, 2, 1]]


def swap_quaternions(quaternions: Array) -> Array:
    """`swap_quaternion` for an (..., 4) array."""
    swapped = -quaternions[..., [0, 2, 1, 3]]
    swapped[..., 3] *= -1.0
    return swapped
