"""Distances between machines as shapes: Chamfer, Hausdorff, intersection over union."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agentflow.diversity.solid import Array, Solid
from agentflow.machine import Machine

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

POINTS = 2048
"""Points on the surface of a machine."""
NUDGE = 1e-6
"""Distance, in diagonals of the machine, at which a point counts as off a surface."""


class ShapeDistances(NamedTuple):
    """How far two machines are apart as shapes, in diagonals of a machine."""

    chamfer: float
    """Mean of both directions' mean distance from a point to the nearest point of the other."""
    hausdorff: float
    """The largest such distance in either direction."""
    iou: float
    """Cells that both occupy, as a share of the cells that either occupies."""


@dataclass(frozen=True)
class Shape:
    """A machine as a solid and as points on its surface."""

    solid: Solid

    @classmethod
    def of(cls, machine: Machine) -> Shape:
        """The shape of a machine."""
        return cls(Solid.of(machine))

    @cached_property
    def points(self) -> Array:
        """(2048, 3): random points on the surface, uniform by area."""
        return surface_points(self.solid, POINTS)

    @cached_property
    def tree(self) -> cKDTree:
        """The points, for finding the nearest one."""
        from scipy.spatial import cKDTree  # an extra

        return cKDTree(self.points)

    def distances(self, other: Shape) -> ShapeDistances:
        """Compare with another shape; the order does not matter."""
        there, _ = other.tree.query(self.points)
        back, _ = self.tree.query(other.points)
        return ShapeDistances(
            float(there.mean() + back.mean()) / 2,
            float(max(there.max(), back.max())),
            self._iou(other),
        )

    def _iou(self, other: Shape) -> float:
        side = max(self.solid.longest, other.solid.longest)
        one, two = self.solid.occupancy(side), other.solid.occupancy(side)
        return float((one & two).sum() / (one | two).sum())


def surface_points(solid: Solid, count: int) -> Array:
    """Random points on the surface of the union of boxes, uniform by area; equal solids get equal
    points.

    Points are drawn on the faces of all boxes, each face by its area. Those within or against
    another box are dropped, and where the faces of several boxes coincide, only the first counts.

    Returns:
        (count, 3), in diagonals of the machine.
    """
    rng = np.random.default_rng(solid.seed)
    centres, halves, axes = solid.boxes()
    area = np.stack([halves[:, 1] * halves[:, 2], halves[:, 0] * halves[:, 2],
                     halves[:, 0] * halves[:, 1]], axis=1).ravel()  # fmt: skip
    kept: list[Array] = []
    while sum(map(len, kept)) < count:
        face = rng.choice(area.size, count, p=area / area.sum())
        box, axis = np.divmod(face, 3)
        place = rng.uniform(-1, 1, (count, 3))
        every = np.arange(count)
        side = np.where(place[every, axis] < 0, -1.0, 1.0)
        place[every, axis] = side
        points = centres[box] + np.einsum("pi,pij->pj", place * halves[box], axes[box])
        out = NUDGE * side[:, None] * axes[box, axis]
        covered = _inside(points + out, centres, halves, axes).any(axis=1)
        first = _inside(points - out, centres, halves, axes).argmax(axis=1)
        kept.append(points[~covered & (first == box)])
    return np.concatenate(kept)[:count]


def _inside(points: Array, centres: Array, halves: Array, axes: Array) -> NDArray[np.bool_]:
    """(points, boxes): which points lie in which boxes."""
    own = np.einsum("pbi,bji->pbj", points[:, None] - centres, axes)
    found: NDArray[np.bool_] = (np.abs(own) < halves).all(axis=2)
    return found
