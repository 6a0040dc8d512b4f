"""Rows: the motion of rigid clusters as numbers, right-handed with z up.

C rows, one per rigid cluster: position 0:3 of its leading part's centre, quaternion 3:7
(x, y, z, w), velocity 7:10 of that centre, angular velocity 10:13.
"""

from collections.abc import Sequence
from math import sqrt
from typing import Protocol

from agentflow.env.rollout import Array
from agentflow.env.rotations import cross, matrices, turn
from agentflow.machine.geometry.vectors import Vec3

POSITION, ROTATION = slice(0, 3), slice(3, 7)
VELOCITY, SPIN = slice(7, 10), slice(10, 13)
WIDTH = 13
Row = Sequence[float]
"""One such row as plain numbers."""


class Rows(Protocol):
    """All rows after the last step."""

    def __getitem__(self, row: int) -> Row:
        """One row."""

    @property
    def all(self) -> list[Row]:
        """Every row; a new list after each step."""

    @property
    def table(self) -> Array:
        """(C, 13) every row; a new array after each step."""


def move_rows(rows: Array, offsets: Array) -> Array:
    """Rows moved to points that lie `offsets` (at rest) away in the same rigid clusters."""
    moved: Array = rows.copy()
    arms = turn(matrices(rows[:, ROTATION]), offsets)
    moved[:, POSITION] += arms
    moved[:, VELOCITY] += cross(rows[:, SPIN], arms)
    return moved


def centre_of(row: Row, arm: Vec3) -> Vec3:
    """Centre of a block, game frame, from the row of its cluster and its place there at rest,
    engine frame: `rotate_vector` and `swap`, written out for referees and sensors."""
    px, py, pz, x, y, z, w, _, _, _, _, _, _ = row
    if not any(arm):
        return px + 0.0, pz + 0.0, py + 0.0
    a, b, c = arm
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    a, b, c = a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u
    return px + a, pz + c, py + b


def top_speeds(rows: Sequence[Row]) -> tuple[float, float]:
    """Greatest linear and angular speed, m/s and rad/s."""
    linear = angular = 0.0
    for _, _, _, _, _, _, _, vx, vy, vz, wx, wy, wz in rows:
        speed, spin = vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
        # written so that NaN wins
        linear = linear if speed <= linear else speed
        angular = angular if spin <= angular else spin
    return sqrt(linear), sqrt(angular)
