"""Machines as sets of boxes in space, centred, with a diagonal of 1, and distances between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agentflow.machine import Machine, place
from agentflow.machine.geometry.pose import UNITS
from agentflow.machine.geometry.statics import END_RADIUS

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


Array = NDArray[np.float64]

CELLS = 32
"""Cells of the occupancy grid along the longest side of what it holds."""


@dataclass(frozen=True)
class Solid:
    """The union of a machine's boxes, moved and scaled so that the box around them is centred at
    the origin and has a diagonal of 1.

    A two-ended block is a rod with a square section between its ends. As elsewhere, it does not
    count for the size of the machine. Block ids and the order of blocks do not matter.

    `lo` and `hi`, (boxes, 3), are the corners of the boxes of standard blocks, and `ends`, (rods,
    2, 3), those of two-ended blocks, all sorted. `radius` is half the thickness of rods: that of
    the balls that two-ended blocks have as ends.
    """

    lo: Array
    hi: Array
    ends: Array
    radius: float

    @classmethod
    def of(cls, machine: Machine) -> Solid:
        """Place the blocks of a machine."""
        geometry = place(machine)
        boxes = sorted((b.lo, b.hi) for b in geometry.blocks if not b.two_ended)
        rods = sorted(sorted((b.at, b.far)) for b in geometry.blocks if b.far is not None)
        low, high = np.array(geometry.lo), np.array(geometry.hi)
        diagonal = float(np.linalg.norm(high - low))

        def scale(points: Any, count: int) -> Array:
            units = np.asarray(points, dtype=np.float64).reshape(-1, count, 3)
            scaled: Array = (units - (low + high) / 2) / diagonal
            return scaled

        corners = scale(boxes, 2)
        return cls(corners[:, 0], corners[:, 1], scale(rods, 2), END_RADIUS * UNITS / diagonal)

    @cached_property
    def seed(self) -> int:
        """Seed of the random points on this solid: equal solids have equal points."""
        content = b"".join(part.astype("<f8").tobytes() for part in (self.lo, self.hi, self.ends))
        return int.from_bytes(sha256(content).digest()[:8], "little")

    @cached_property
    def longest(self) -> float:
        """Longest side of the box around the standard blocks."""
        return float((self.hi.max(axis=0) - self.lo.min(axis=0)).max())

    def boxes(self) -> tuple[Array, Array, Array]:
        """Centres (n, 3), half sizes (n, 3) and own axes (n, 3, 3; rows) of boxes and rods."""
        middle, half = (self.lo + self.hi) / 2, (self.hi - self.lo) / 2
        along = self.ends[:, 1] - self.ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        thick = np.full((len(length), 2), self.radius)
        return (
            np.concatenate([middle, self.ends.mean(axis=1)]),
            np.concatenate([half, np.column_stack([thick, length / 2 + self.radius])]),
            np.concatenate([np.broadcast_to(np.eye(3), (len(half), 3, 3)), _frames(along)]),
        )

    def occupancy(self, side: float) -> NDArray[np.bool_]:
        """Which cells of a centred cube with this side hold a block, as (32, 32, 32).

        A cell counts if its centre is in a box. Where a box is thinner than a cell, one layer of
        cells counts; a rod counts as the cells that its axis passes through.
        """
        grid = np.zeros((CELLS,) * 3, dtype=np.bool_)
        lo, hi = ((corner / side + 0.5) * CELLS for corner in (self.lo, self.hi))
        first = np.ceil(lo - 0.5 - 1e-9).astype(int)
        last = np.floor(hi - 0.5 - 1e-9).astype(int)
        thin = last < first
        middle = np.minimum(((lo + hi) / 2).astype(int), CELLS - 1)
        first, last = np.where(thin, middle, first), np.where(thin, middle, last)
        for (x0, y0, z0), (x1, y1, z1) in zip(first.tolist(), (last + 1).tolist(), strict=True):
            grid[x0:x1, y0:y1, z0:z1] = True
        points = np.linspace(self.ends[:, 0], self.ends[:, 1], 4 * CELLS).reshape(-1, 3)
        cells = np.clip(((points / side + 0.5) * CELLS).astype(int), 0, CELLS - 1)
        grid[tuple(cells.T)] = True
        return grid

    @cached_property
    def points(self) -> Array:
        """(2048, 3): random points on the surface, uniform by area."""
        return surface_points(self, POINTS)

    @cached_property
    def tree(self) -> cKDTree:
        """The points, for finding the nearest one."""
        from scipy.spatial import cKDTree  # an extra

        return cKDTree(self.points)

    def distances(self, other: Solid) -> ShapeDistances:
        """Compare with another machine; the order does not matter."""
        there, _ = other.tree.query(self.points)
        back, _ = self.tree.query(other.points)
        return ShapeDistances(
            float(there.mean() + back.mean()) / 2,
            float(max(there.max(), back.max())),
            self._iou(other),
        )

    def _iou(self, other: Solid) -> float:
        side = max(self.longest, other.longest)
        one, two = self.occupancy(side), other.occupancy(side)
        return float((one & two).sum() / (one | two).sum())


def _frames(along: Array) -> Array:
    """(n, 3, 3): orthonormal axes, as rows, whose last one points along each vector."""
    frames = np.empty((len(along), 3, 3))
    for frame, vector in zip(frames, along, strict=True):
        length = float(np.linalg.norm(vector))
        front = vector / length if length else np.array([0.0, 0.0, 1.0])
        side = np.cross(np.eye(3)[np.abs(front).argmin()], front)
        frame[0] = side / np.linalg.norm(side)
        frame[1], frame[2] = np.cross(front, frame[0]), front
    return frames


POINTS = 2048
NUDGE = 1e-6
"""Distance, in diagonals of the machine, at which a point counts as off a surface."""


class ShapeDistances(NamedTuple):
    """How far two machines are apart as shapes, in diagonals of a machine.

    `chamfer` is the mean of both directions' mean distance from a point to the nearest point of the
    other, `hausdorff` the largest such distance in either direction, and `iou` the cells that both
    occupy, as a share of those that either occupies.
    """

    chamfer: float
    hausdorff: float
    iou: float


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
