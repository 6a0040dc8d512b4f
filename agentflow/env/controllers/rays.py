"""Where a ray first meets the ground or an object of a scene; the same on every engine."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from agentflow.env.physics.engine import World
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.controllers.model import RANGE
from agentflow.machine.geometry.vectors import (
    IDENTITY,
    Quat,
    Vec3,
    dot,
    inverse,
    length,
    rotate_vector,
    subtract,
)

REACH = RANGE + 0.01
"""How far a ray goes, m."""
SLACK = 1e-6
"""By how much what bounds an object is larger, m."""
FEW = 24
"""So many objects are asked one by one in less time than an array leaves most out."""


class Rays:
    """The ground, boxes and spheres of a scene; cylinders and cones count as boxes."""

    def __init__(self, scene: Scene, world: World) -> None:
        """Keep what bounds what does not move; what moves is asked for."""
        self._world, self._moving = world, [item for item in scene.objects if item.mass]
        self._fixed = [(*_bounds(item), item) for item in scene.objects if not item.mass]
        """Lower and upper corner, and object."""
        self._corners = np.array([bounds for *bounds, _ in self._fixed]).reshape(-1, 6)

    def first(self, x: float, y: float, z: float, u: float, v: float, w: float) -> float:
        """Distance from a place along a unit vector to the first surface, m; inf if there is none
        in `RANGE`.

        What the start is inside of does not count.
        """
        left, right = (x + REACH * u, x) if u < 0.0 else (x, x + REACH * u)
        below, above = (y + REACH * v, y) if v < 0.0 else (y, y + REACH * v)
        behind, ahead = (z + REACH * w, z) if w < 0.0 else (z, z + REACH * w)
        nearest, fixed = y / -v if v < 0.0 < y else inf, self._fixed
        if len(fixed) > FEW:
            low, high = self._corners[:, :3], self._corners[:, 3:]
            near = (high >= (left, below, behind)) & (low <= (right, above, ahead))
            fixed = [fixed[i] for i in np.flatnonzero(near.all(axis=1)).tolist()]
        for a, b, c, p, q, r, item in fixed:
            if p < left or a > right or r < behind or c > ahead or q < below or b > above:
                continue
            i, j, k = item.position
            if item.rotation is IDENTITY and item.shape != "sphere":
                distance = _meet_box(x - i, y - j, z - k, u, v, w, item.size)
            else:
                distance = _meet(item, (x - i, y - j, z - k), (u, v, w))
            nearest = distance if distance < nearest else nearest
        for item in self._moving:
            px, py, pz, a, b, c, d, _, _, _, _, _, _ = self._world.row(item.name)
            place = (
                (px, pz, py) if item.balance == (0.0, 0.0, 0.0) else self._world.centre(item.name)
            )
            distance = _meet(item, subtract((x, y, z), place), (u, v, w), (-a, -c, -b, d))
            nearest = distance if distance < nearest else nearest
        return nearest


def _bounds(item: SceneObject) -> tuple[float, float, float, float, float, float]:
    """Lower and upper corner of what an object that does not move is in."""
    sides = item.size if item.rotation is IDENTITY else (length(item.size),) * 3
    i, j, k = (side / 2 + SLACK for side in sides)
    x, y, z = item.position
    return x - i, y - j, z - k, x + i, y + j, z + k


def _meet(item: SceneObject, start: Vec3, way: Vec3, rotation: Quat | None = None) -> float:
    """Distance to an object's surface from a place that is `start` from its centre."""
    if item.shape == "sphere":
        return _meet_sphere(start, way, item.size[0] / 2)
    back = inverse(rotation or item.rotation)
    return _meet_box(*rotate_vector(back, start), *rotate_vector(back, way), item.size)


def _meet_sphere(start: Vec3, way: Vec3, radius: float) -> float:
    along = -dot(start, way)
    square = radius * radius - dot(start, start) + along * along
    distance = along - sqrt(square) if square >= 0.0 else -1.0
    return distance if distance >= 0.0 else inf


def _meet_box(x: float, y: float, z: float, u: float, v: float, w: float, size: Vec3) -> float:
    """Written out, as a loop takes twice as long; z comes first, as most rays look along it."""
    wide, high, long = size[0] / 2, size[1] / 2, size[2] / 2
    near, far = -inf, inf
    if not -1e-12 < w < 1e-12:
        half = long if w < 0.0 else -long
        near, far = (half - z) / w, (-half - z) / w
    elif not -long <= z <= long:
        return inf
    if not -1e-12 < u < 1e-12:
        half = wide if u < 0.0 else -wide
        one, other = (half - x) / u, (-half - x) / u
        near, far = one if one > near else near, other if other < far else far
        if near > far:
            return inf
    elif not -wide <= x <= wide:
        return inf
    if not -1e-12 < v < 1e-12:
        half = high if v < 0.0 else -high
        one, other = (half - y) / v, (-half - y) / v
        near, far = one if one > near else near, other if other < far else far
        if near > far:
            return inf
    elif not -high <= y <= high:
        return inf
    return near if near >= 0.0 else inf
