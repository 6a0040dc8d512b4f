"""Owns the forces that engines must apply by hand: drag, wind, springs (spec 2.1, 2.2).

Works on cluster rows (see kinematics.py) in any right-handed frame; applying is the engine's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agentflow.env.engines.base import Part, Pull
from agentflow.env.engines.kinematics import (
    POSITION,
    ROTATION,
    VELOCITY,
    carried,
    cross,
    matrices,
    turn_back,
)
from agentflow.env.trace import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Members:
    """Which parts make up the clusters, and where they sit."""

    row: Indices
    """(P,) row of each part."""
    offset: Array
    """(P, 3) from the leading part's centre to this part's, at rest, engine frame."""


class Resistance:
    """Drag of every part, summed per cluster into one matrix each, and wind where it blows."""

    def __init__(
        self,
        parts: Sequence[Part],
        members: Members,
        rows: int,
        inertia: Array,
        extents: Array,
        wind: Array,
        wind_drag: float,
    ) -> None:
        """Sum up the drag of `parts` about each cluster's leading centre.

        Args:
            parts: All parts, in order.
            members: Their places.
            rows: Number of clusters.
            inertia: (P, 3) principal moments, engine frame.
            extents: (P, 3) boxes that the wind sees, engine frame.
            wind: (3,) velocity of the air, m/s, engine frame.
            wind_drag: Force over area times squared speed, kg/m3.
        """
        self._members = members
        self._drag = _drag_matrices(parts, members, rows, inertia)
        self._wind, self._wind_drag = wind, wind_drag
        self._areas = extents[:, [1, 0, 0]] * extents[:, [2, 2, 1]]
        self._windy = bool(np.any(wind != 0.0))
        dragged = [bool(np.any(matrix != 0.0)) for matrix in self._drag]
        self.rows: list[int] = [i for i in range(rows) if self._windy or dragged[i]]
        """Rows on which a force acts."""

    def __call__(self, rows: Array) -> Array:
        """(C, 6) force and torque at each leading centre, in the clusters' own frames."""
        rotation = matrices(rows[:, ROTATION])
        speeds = rows[:, 7:13].reshape(-1, 2, 3)
        terms = rotation[:, None] * speeds[:, :, :, None]
        local = (terms[:, :, 0] + terms[:, :, 1] + terms[:, :, 2]).reshape(-1, 6)
        terms = self._drag * local[:, None, :]
        wrench = terms[:, :, 0] + terms[:, :, 1]
        for column in range(2, 6):
            wrench += terms[:, :, column]
        if self._windy:
            wrench += self._blow(rotation, local)
        return np.asarray(wrench)

    def _blow(self, rotation: Array, local: Array) -> Array:
        row, offset = self._members.row, self._members.offset
        air = turn_back(rotation, np.broadcast_to(self._wind, (len(rotation), 3)))
        along = air[row] - local[row, :3] - cross(local[row, 3:], offset)
        facing = self._areas * np.abs(along)
        strength = self._wind_drag * (facing[:, 0] + facing[:, 1] + facing[:, 2])
        force = strength[:, None] * along
        torque = cross(offset, force)
        wrench = np.zeros((len(rotation), 6))
        for axis in range(3):
            wrench[:, axis] = np.bincount(row, force[:, axis], len(rotation))
            wrench[:, axis + 3] = np.bincount(row, torque[:, axis], len(rotation))
        return wrench


def _drag_matrices(parts: Sequence[Part], members: Members, rows: int, inertia: Array) -> Array:
    """(C, 6, 6): force and torque per velocity and angular velocity, in the cluster's frame."""
    total = np.zeros((rows, 6, 6))
    for i, part in enumerate(parts):
        x, y, z = members.offset[i].tolist()
        linear = part.mass * part.linear_drag
        arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        arm_squared = np.array(
            [
                [-(y * y + z * z), x * y, x * z],
                [x * y, -(x * x + z * z), y * z],
                [x * z, y * z, -(x * x + y * y)],
            ]
        )
        matrix = total[members.row[i]]
        matrix[:3, :3] -= linear * np.eye(3)
        matrix[:3, 3:] += linear * arm
        matrix[3:, :3] -= linear * arm
        matrix[3:, 3:] += linear * arm_squared - np.diag(inertia[i] * part.angular_drag)
    return total


class Springs:
    """The pulls of all springs."""

    def __init__(self, pulls: Sequence[Pull], members: Members) -> None:
        self._a = np.array([pull.a for pull in pulls], dtype=np.intp)
        self._b = np.array([pull.b for pull in pulls], dtype=np.intp)
        self._members = members
        self._natural = np.array([pull.natural for pull in pulls])
        self._ramp = np.array([pull.ramp for pull in pulls])
        self._force = np.array([pull.force for pull in pulls])
        self._damping = np.array([pull.damping for pull in pulls])

    def __call__(self, rows: Array) -> tuple[Array, Array, Array]:
        """Force on each end a, (L, 3); ends b get the opposite. Then the ends' places."""
        row, offset = self._members.row, self._members.offset
        end_a = carried(rows[row[self._a]], offset[self._a])
        end_b = carried(rows[row[self._b]], offset[self._b])
        line = end_b[:, POSITION] - end_a[:, POSITION]
        square = line * line
        distance = np.maximum(np.sqrt(square[:, 0] + square[:, 1] + square[:, 2]), 1e-9)
        direction = line / distance[:, None]
        closing = direction * (end_b[:, VELOCITY] - end_a[:, VELOCITY])
        rate = closing[:, 0] + closing[:, 1] + closing[:, 2]
        stretch = np.clip((distance - self._natural) / self._ramp, 0.0, 1.0)
        pull = np.where(stretch > 0.0, self._force * stretch + self._damping * rate, 0.0)
        force = np.maximum(pull, 0.0)[:, None] * direction
        return force, end_a[:, POSITION], end_b[:, POSITION]
