"""The first collision of what a turning joint carries with the rest of the machine or the ground.

The shapes are those that are simulated, except that round ones have 24 sides and a container is a
full box. Blocks that lie within each other as built do not count.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import DIRECTIONS
from agentflow.machine.geometry.placement import Geometry
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.statics import Load

Array = NDArray[np.float64]
SHRINK = 0.02
"""m by which simulated shapes are smaller on each side; `shrink` in env/constants.json."""
HINGE_PLATE = 0.3
"""Thickness of hinges across their swing, m, as simulated."""
SIDES = 24
STEP, HALVINGS = 2.0, 5
"""Angles tried, degrees; the first hit is then narrowed down to less than 0.1 degree."""
TOUCH = 0.005
"""m by which something must reach into the ground to hit it."""

Test = Callable[[Array], NDArray[np.bool_]]
"""(T, 3, 3) rotations about the pivot -> (T,) whether the two meet."""


@dataclass(frozen=True)
class Collision:
    """Two blocks that meet, or a block and the ground."""

    angle: float
    """degrees from the machine as built."""
    block: int
    """Carried by the joint."""
    other: int | None
    """Not carried by it; None: the ground."""


@dataclass(frozen=True)
class _Hull:
    """A convex body, relative to the pivot."""

    block: int
    points: Array
    """(n, 3)."""
    normals: Array
    """(k, 3) of its sides; opposite sides share one."""
    edges: Array
    """(m, 3) directions."""


def first_collision(geometry: Geometry, load: Load, sense: int, limit: float) -> Collision | None:
    """The first collision when a joint turns from the machine as built; None if there is none.

    Of machines on banks, which hang over lower ground, collisions with the ground are left out.

    Args:
        geometry: The machine.
        load: What the joint carries.
        sense: 1 or -1, for positive or negative turns about its axis.
        limit: Greatest angle, degrees.
    """
    pivot, axis = np.array(load.bond.pivot), sense * np.array(load.bond.axis)
    angles = np.arange(0.0, limit + STEP / 2, STEP)
    turns = _turns(axis, angles)
    rest = [b.id for b in geometry.blocks if b.id not in load.blocks]
    others = list(_hulls(geometry, rest, pivot))
    floor = geometry.box_min[1] + SHRINK - TOUCH - pivot[1]
    found: list[Collision] = []
    for moving in _hulls(geometry, sorted(load.blocks), pivot):
        for other, meets in _tests(geometry, moving, others, axis, float(floor)):
            hits = meets(turns)
            if hits.any() and not hits[0]:
                angle = _narrow(meets, axis, float(angles[int(hits.argmax())]))
                found.append(Collision(angle, moving.block, other))
    return min(found, key=lambda item: item.angle, default=None)


def _tests(
    geometry: Geometry, moving: _Hull, others: Iterable[_Hull], axis: Array, floor: float
) -> Iterator[tuple[int | None, Test]]:
    """What the moving body may meet, and the test whether it does."""
    if not geometry.banks:
        yield (
            None,
            lambda turns: (moving.points @ turns.transpose(0, 2, 1))[..., 1].min(axis=1) < floor,
        )
    low, high = _ring(moving, axis)
    for other in others:
        near, far = _ring(other, axis)
        joined = geometry[moving.block].step.parent == other.block
        if (near <= high).all() and (low <= far).all() and not joined:
            yield other.block, partial(_meet, moving, other)


def _ring(hull: _Hull, axis: Array) -> tuple[Array, Array]:
    """Least and greatest (distance from the axis, position along it)."""
    along = hull.points @ axis
    away = np.linalg.norm(hull.points - along[:, None] * axis, axis=1)
    middle = hull.points.mean(axis=0)
    size = np.linalg.norm(hull.points - middle, axis=1).max()
    inner = np.linalg.norm(middle - (middle @ axis) * axis) - size
    return np.array((inner, along.min())), np.array((away.max(), along.max()))


def _meet(moving: _Hull, other: _Hull, turns: Array) -> NDArray[np.bool_]:
    """Whether no plane separates the two bodies, by the separating axis theorem."""
    back = turns.transpose(0, 2, 1)
    points, own = moving.points @ back, moving.normals @ back
    across = np.cross((moving.edges @ back)[:, :, None], other.edges[None, None]).reshape(
        len(turns), -1, 3
    )
    fixed = np.broadcast_to(other.normals, (len(turns), *other.normals.shape))
    axes = np.concatenate((own, fixed, across), axis=1).transpose(0, 2, 1)
    a, b = points @ axes, other.points @ axes
    apart = (a.max(axis=1) < b.min(axis=1)) | (b.max(axis=1) < a.min(axis=1))
    return np.asarray(~apart.any(axis=1))


def _narrow(meets: Test, axis: Array, angle: float) -> float:
    """The least angle at which two bodies meet, between the last two angles tried."""
    low, high = angle - STEP, angle
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if meets(_turns(axis, np.array([middle])))[0]:
            high = middle
        else:
            low = middle
    return high


def _turns(axis: Array, degrees: Array) -> Array:
    """(T, 3, 3) rotations about an axis."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angles = np.radians(degrees)[:, None, None]
    turned = np.eye(3) + np.sin(angles) * across + (1.0 - np.cos(angles)) * (across @ across)
    return np.asarray(turned)


def _hulls(geometry: Geometry, blocks: Iterable[int], pivot: Array) -> Iterator[_Hull]:
    """The bodies of these blocks; two-ended blocks collide with nothing."""
    for block in blocks:
        placed = geometry[block]
        if not placed.two_ended:
            points, normals, edges = _shape(placed)
            yield _Hull(block, points + np.array(placed.center) - pivot, normals, edges)


def _shape(placed: Placed) -> tuple[Array, Array, Array]:
    """Corners from the middle of a block, normals of its sides, directions of its edges."""
    kind, axes = library()[placed.type], np.eye(3)
    half = (np.array(placed.box_max) - np.array(placed.box_min)) / 2 - SHRINK
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    if kind.shape == "sphere":
        ways = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        return half[0] * ways, ways, np.empty((0, 3))
    if kind.shape == "cylinder":
        front = np.array(placed.front)
        flat = [np.array(side) for side in (placed.right, placed.up)]
        radius = float(max(half @ abs(flat[0]), half @ abs(flat[1])))
        turns = [2 * pi * (i + 0.5) / SIDES for i in range(SIDES)]
        rim = np.array([cos(t) * flat[0] + sin(t) * flat[1] for t in turns])
        ends = [sign * float(half @ abs(front)) * front for sign in (-1.0, 1.0)]
        points = np.concatenate([radius * rim + end for end in ends])
        sides = np.array([cos(2 * pi * i / SIDES) * flat[0] + sin(2 * pi * i / SIDES) * flat[1]
                          for i in range(SIDES // 2)])  # fmt: skip
        normals = np.concatenate([sides, front[None]])
        return points, normals, np.concatenate([np.cross(sides, front), front[None]])
    if kind.shape == "hinge":
        swing = placed.orientation.turn(DIRECTIONS[kind.joint.axis])
        thin = abs(np.cross(np.array(swing), np.array(placed.front)))
        half = np.where(thin > 0.5, HINGE_PLATE / 2, half)
    return signs * half, axes, axes
