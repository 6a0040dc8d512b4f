"""Where a ray first meets the ground or an object of a scene; the same on every engine."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from agentflow.env.physics.engine import World
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.geometry.vectors import (
    IDENTITY,
    Vec3,
    dot,
    inverse,
    length,
    rotate_vector,
    subtract,
)

FEW = 12
"""Up to so many objects, asking each takes less time than an array that leaves most out."""


class Rays:
    """The ground, boxes and spheres of a scene; cylinders and cones count as boxes."""

    def __init__(self, scene: Scene, world: World) -> None:
        """Keep what does not move; what moves is asked for."""
        self._world, self._objects = world, scene.objects
        self._few = len(scene.objects) <= FEW
        upright = [
            index
            for index, item in enumerate(scene.objects)
            if not item.mass and item.shape != "sphere" and item.rotation is IDENTITY
        ]
        self._boxes = [
            (*(scene.objects[i].position), *(side / 2 for side in scene.objects[i].size))
            for i in upright
        ]
        """Centres and half sides of those that neither move nor are turned."""
        self._others = [i for i in range(len(scene.objects)) if i not in upright]
        self._centres = np.array([item.position for item in scene.objects]).reshape(-1, 3)
        radii = [inf if item.mass else length(item.size) / 2 for item in scene.objects]
        self._squares = np.array(radii) ** 2
        """Of the radius around each object; of those that move, infinite."""

    def first(self, start: Vec3, way: Vec3) -> float:
        """Distance along a unit vector to the first surface, m; inf if there is none.

        What the start is inside of does not count.
        """
        nearest = start[1] / -way[1] if way[1] < 0.0 < start[1] else inf
        for index in self._others if self._few else self._near(start, way):
            distance = self._meet(self._objects[index], start, way)
            nearest = distance if distance < nearest else nearest
        return self._first_box(start, way, nearest) if self._few else nearest

    def _first_box(self, start: Vec3, way: Vec3, nearest: float) -> float:
        """The least of `nearest` and the distances to the boxes: `_meet_box` written out, which
        runs in every reading, and ends where a box can no longer count."""
        (x, y, z), (u, v, w) = start, way
        along = -1e-12 < w < 1e-12, -1e-12 < u < 1e-12, -1e-12 < v < 1e-12
        for a, b, c, p, q, r in self._boxes:
            near, far = -inf, inf
            if not along[0]:
                at, half = z - c, r if w > 0.0 else -r
                near, far = (-half - at) / w, (half - at) / w
                if far < 0.0 or near >= nearest:
                    continue
            elif not -r <= z - c <= r:
                continue
            if not along[1]:
                at, half = x - a, p if u > 0.0 else -p
                one, other = (-half - at) / u, (half - at) / u
                near, far = one if one > near else near, other if other < far else far
                if near > far or near >= nearest:
                    continue
            elif not -p <= x - a <= p:
                continue
            if not along[2]:
                at, half = y - b, q if v > 0.0 else -q
                one, other = (-half - at) / v, (half - at) / v
                near, far = one if one > near else near, other if other < far else far
                if near > far:
                    continue
            elif not -q <= y - b <= q:
                continue
            nearest = near if 0.0 <= near < nearest else nearest
        return nearest

    def _near(self, start: Vec3, way: Vec3) -> list[int]:
        """The objects that the line may meet."""
        apart = self._centres - start
        along = apart @ np.array(way)
        aside = np.einsum("ij,ij->i", apart, apart) - along * along
        found: list[int] = np.flatnonzero(aside <= self._squares).tolist()
        return found

    def _meet(self, item: SceneObject, start: Vec3, way: Vec3) -> float:
        place, rotation = item.position, item.rotation
        if item.mass:
            place, rotation = self._world.centre(item.name), self._world.rotation(item.name)
        start = subtract(start, place)
        if item.shape == "sphere":
            return _meet_sphere(start, way, item.size[0] / 2)
        if rotation is not IDENTITY:
            back = inverse(rotation)
            start, way = rotate_vector(back, start), rotate_vector(back, way)
        return _meet_box(start, way, item.size)


def _meet_sphere(start: Vec3, way: Vec3, radius: float) -> float:
    along = -dot(start, way)
    square = radius * radius - dot(start, start) + along * along
    distance = along - sqrt(square) if square >= 0.0 else -1.0
    return distance if distance >= 0.0 else inf


def _meet_box(start: Vec3, way: Vec3, size: Vec3) -> float:
    near, far = -inf, inf
    for axis in (2, 0, 1):  # most rays look along z
        at, speed, half = start[axis], way[axis], size[axis] / 2
        if -1e-12 < speed < 1e-12:
            if not -half <= at <= half:
                return inf
            continue
        one, other = (-half - at) / speed, (half - at) / speed
        if one > other:
            one, other = other, one
        near, far = one if one > near else near, other if other < far else far
        if near > far:
            return inf
    return near if near >= 0.0 else inf
