"""Input and output of force laws: positions of parts in their clusters, forces and wrenches.

A law is called in every step with the rows of all clusters (see `physics.rows`) and returns forces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agentflow.env.physics.rows import Row
from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import Vec3, add, cross, rotate_vector

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class PartLocations:
    """The cluster of each part, and its place in it."""

    row: Indices
    """(P,) row of each part's cluster."""
    offset: Array
    """(P, 3) from the leading part's centre to this part's, at rest, engine frame."""

    def locate(self, part: int) -> tuple[int, Vec3]:
        """Row and offset of one part."""
        x, y, z = self.offset[part].tolist()
        return int(self.row[part]), (x, y, z)


class Wrench(NamedTuple):
    """Force (N) and torque (N m) on a cluster at its leading part's centre."""

    row: int
    local: bool
    """Whether they are in the cluster's own axes rather than the engine's."""
    force: Vec3
    torque: Vec3 | None
    """None if there is no torque."""


class PartForce(NamedTuple):
    """Force at the centre of one part; the joints between it and its cluster carry it."""

    part: int
    """Part index; moving things are numbered on from the last part."""
    force: Vec3
    """N."""
    at: Vec3 | None
    """Position of the centre, with the force in the engine's axes; None if the force is in the
    part's own axes."""


def part_motion(row: Row, offset: Vec3) -> tuple[Vec3, Vec3]:
    """Position and velocity of a part's centre.

    Args:
        row: Of the part's cluster.
        offset: From the centre of the cluster's leading part to this part's, at rest.
    """
    px, py, pz, x, y, z, w, vx, vy, vz, wx, wy, wz = row
    arm = rotate_vector((x, y, z, w), offset)
    return add((px, py, pz), arm), add((vx, vy, vz), cross((wx, wy, wz), arm))
