"""Shapes of machines: points on surfaces, distances, cells."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from scipy.spatial.distance import cdist, directed_hausdorff

from agentflow.diversity.solid import CELLS, POINTS, Solid, surface_points
from agentflow.machine import ROOT, Machine
from agentflow.machine.edits.random import random_machine
from tests.diversity.relabelling import relabel
from tests.machine.builders import CAR, CATAPULT, build

STARTING_BLOCK = Machine((ROOT,))
BRACED = build((63, 0, 0), (63, 0, 1), (7, 1, 0, 2, 0))
"""Two logs and a brace between their ends."""


def shape(machine: Machine) -> Solid:
    return Solid.of(machine)


def test_a_solid_is_centred_with_a_unit_diagonal() -> None:
    solid = Solid.of(CATAPULT)
    low, high = solid.lo.min(axis=0), solid.hi.max(axis=0)
    assert low + high == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(high - low) == pytest.approx(1)


def test_a_brace_is_a_rod_between_its_ends() -> None:
    solid = Solid.of(BRACED)
    assert solid.ends.shape == (1, 2, 3)
    _, halves, axes = solid.boxes()
    length = np.linalg.norm(solid.ends[0, 1] - solid.ends[0, 0])
    assert halves[-1] == pytest.approx([solid.radius, solid.radius, length / 2 + solid.radius])
    assert axes[-1] @ axes[-1].T == pytest.approx(np.eye(3))
    assert len(Solid.of(build((63, 0, 0), (63, 0, 1))).ends) == 0


def test_it_does_not_matter_which_end_of_a_brace_is_the_first() -> None:
    turned = build((63, 0, 0), (63, 0, 1), (7, 2, 0, 1, 0))
    assert shape(BRACED).distances(shape(turned)) == (0, 0, 1)


def test_points_lie_on_the_surface_of_the_union() -> None:
    """On some box, and within none: the points of a machine without overlaps or rods."""
    solid = Solid.of(CAR)
    points = surface_points(solid, POINTS)[:, None]
    assert points.shape == (POINTS, 1, 3)
    depth = np.minimum(points - solid.lo, solid.hi - points).min(axis=2)
    """How deep a point lies in each box; negative outside."""
    assert depth.max(axis=1) == pytest.approx(0, abs=1e-9)


def test_points_are_spread_by_area() -> None:
    """A cube: a sixth on each face. A log, 3 m long, ahead of it: it hides one, and has more."""
    cube = surface_points(Solid.of(STARTING_BLOCK), 6000)
    faces = [(np.abs(cube[:, axis] - side * cube.max()) < 1e-9).sum() for axis in range(3)
             for side in (-1, 1)]  # fmt: skip
    assert sum(faces) == 6000
    assert faces == pytest.approx([1000] * 6, abs=100)
    both = Solid.of(build((63, 0, 0)))
    points = surface_points(both, 6000)
    (seam,) = set(both.hi[:, 2].round(9)) & set(both.lo[:, 2].round(9))
    assert np.abs(points[:, 2] - seam).min() > 0
    assert (points[:, 2] < seam).mean() == pytest.approx(5 / (5 + 13), abs=0.02)


def test_faces_that_coincide_count_once() -> None:
    """Two logs in the same place have the points of one."""
    doubled = Solid.of(build((63, 0, 0), (63, 0, 0)))
    seam = doubled.hi[:, 2].min()
    points = surface_points(doubled, 6000)
    assert (points[:, 2] < seam).mean() == pytest.approx(5 / (5 + 13), abs=0.02)


@pytest.mark.parametrize("other", [CAR, BRACED, STARTING_BLOCK])
def test_distances_by_brute_force(other: Machine) -> None:
    a, b = shape(CATAPULT), shape(other)
    every = cdist(a.points, b.points)
    there, back = every.min(axis=1), every.min(axis=0)
    found = a.distances(b)
    assert found.chamfer == pytest.approx((there.mean() + back.mean()) / 2)
    assert found.hausdorff == pytest.approx(max(there.max(), back.max()))
    known = (directed_hausdorff(a.points, b.points)[0], directed_hausdorff(b.points, a.points)[0])
    assert found.hausdorff == pytest.approx(max(known))


def test_cells_hold_the_volume_of_the_blocks() -> None:
    """A cube fills its grid; a log of 1 x 1 x 3 m behind a cube of 1 m fills 4 of 4 x 4 x 4 m."""
    assert Solid.of(STARTING_BLOCK).occupancy(Solid.of(STARTING_BLOCK).longest).all()
    both = Solid.of(build((63, 0, 0)))
    grid = both.occupancy(both.longest)
    assert grid.sum() == CELLS * (CELLS // 4) ** 2
    assert grid[CELLS // 2, CELLS // 2].all()


def test_a_thin_block_fills_one_layer_of_cells() -> None:
    low, high = np.array([[-0.5, -0.5, 0.399]]), np.array([[0.5, 0.5, 0.401]])
    grid = Solid(low, high, np.empty((0, 2, 3)), 0).occupancy(1)
    assert grid[:, :, int(0.9 * CELLS)].all()
    assert grid.sum() == CELLS**2


def test_a_brace_fills_the_cells_along_its_axis() -> None:
    plain = Solid.of(build((63, 0, 0), (63, 0, 1))).occupancy(0.9)
    braced = Solid.of(BRACED).occupancy(0.9)
    assert braced[plain].all()
    assert CELLS // 4 < braced.sum() - plain.sum() < 3 * CELLS


def test_overlap_of_two_machines_by_hand() -> None:
    """A cube, scaled to a diagonal of 1, and a bar of the same diagonal, in a common grid."""
    cube, bar = shape(STARTING_BLOCK), shape(build((63, 0, 0)))
    one, two = (solid.occupancy(bar.longest) for solid in (cube, bar))
    assert cube.distances(bar).iou == (one & two).sum() / (one | two).sum()
    assert 0 < cube.distances(bar).iou < 1


@pytest.mark.parametrize("seed", range(3))
def test_equal_machines_are_at_distance_zero_whatever_their_ids(seed: int) -> None:
    rng = Random(seed)
    machine, other = random_machine(rng), random_machine(rng)
    renamed = relabel(machine, rng)
    assert renamed != machine
    assert shape(machine).distances(shape(renamed)) == (0, 0, 1)
    assert shape(machine).distances(shape(other)) == shape(renamed).distances(shape(other))


@pytest.mark.parametrize("seed", range(3))
def test_distances_are_symmetric(seed: int) -> None:
    rng = Random(seed)
    a, b = shape(random_machine(rng)), shape(random_machine(rng))
    assert a.distances(b) == pytest.approx(b.distances(a), rel=1e-12)
    assert a.distances(b).chamfer > 0
    assert 0 < a.distances(b).iou < 1
