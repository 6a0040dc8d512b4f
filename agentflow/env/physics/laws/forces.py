"""Input and output of force laws: positions of parts in their clusters, forces and wrenches.

A law is called in every step with the rows of all clusters (see `physics.rows`) and returns forces.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from agentflow.env.physics.rows import Row, Rows
from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import Vec3, dot, rotate_vector

Indices = NDArray[np.intp]
Entry = str | int
"""What a level drives: an entry of the task's schedule, or the block with this id."""


@dataclass(frozen=True)
class PartLocations:
    """The row of each part's cluster, (P,), and the part's place in it, (P, 3): from the leading
    part's centre to its own, at rest, engine frame."""

    row: Indices
    offset: Array

    def locate(self, part: int) -> tuple[int, Vec3]:
        """Row and offset of one part."""
        return self._places[part]

    @cached_property
    def _places(self) -> list[tuple[int, Vec3]]:
        offsets = [(x, y, z) for x, y, z in self.offset.tolist()]
        return list(zip(self.row.tolist(), offsets, strict=True))


# Dozens of these are made in every step, so they are plain tuples.

Wrench = tuple[int, bool, Vec3, Vec3 | None]
"""Force (N) and torque (N m) on a cluster at its leading part's centre.

Its row, whether both are in the cluster's own axes rather than the engine's, the force, and the
torque or None.
"""

PartForce = tuple[int, Vec3, Vec3 | None]
"""Force at the centre of one part; the joints between it and its cluster carry it.

Part index (moving objects are numbered on from the last part), force (N), and position of the
centre, with the force in the engine's axes; None if the force is in the part's own axes.
"""


def part_motion(row: Row, offset: Vec3) -> tuple[Vec3, Vec3]:
    """Position and velocity of a part's centre.

    Args:
        row: Of the part's cluster.
        offset: From the centre of the cluster's leading part to this part's, at rest.
    """
    px, py, pz, x, y, z, w, vx, vy, vz, wx, wy, wz = row
    a, b, c = offset
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)  # as `rotate_vector`
    a, b, c = a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u
    velocity = (vx + (wy * c - wz * b), vy + (wz * a - wx * c), vz + (wx * b - wy * a))
    return (px + a, py + b, pz + c), velocity


def power_of(
    forces: Sequence[PartForce], rows: Sequence[Row] | Rows, locations: PartLocations
) -> float:
    """Rate at which forces on parts do work, W."""
    found = 0.0
    for part, force, at in forces:
        row, offset = locations.locate(part)
        _, velocity = part_motion(rows[row], offset)
        _, _, _, x, y, z, w, *_ = rows[row]
        found += dot(force if at else rotate_vector((x, y, z, w), force), velocity)
    return found
