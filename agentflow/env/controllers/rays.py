"""Where a ray first meets the ground or an object of a scene; the same on every engine."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nan, sqrt
from typing import Any

import numpy as np

from agentflow.env.physics.engine import World
from agentflow.env.rollout import Array
from agentflow.env.scene import Scene, SceneObject
from agentflow.machine.controllers.model import RANGE
from agentflow.machine.geometry.vectors import IDENTITY, Vec3, dot, inverse, length

REACH = RANGE + 0.01
"""How far a ray goes, m."""
SLACK = 1e-6
"""By how much what bounds an object is larger, m."""
INNER = 0.999
"""Squared share of a face that is its inner part: what is met there is met before all other faces,
whatever is rounded."""
_RAY = f"""\
l = cx + {REACH} * i
m = cy + {REACH} * j
n = cz + {REACH} * k
if not (
    left# <= cx and cx <= right# and left# <= l and l <= right#
    and low# <= cy and cy <= high# and low# <= m and m <= high#
    and back# <= cz and cz <= front# and back# <= n and n <= front#
):
    left#, low#, back#, right#, high#, front#, boxes#, others# = look(cx, cy, cz, l, m, n)
e = {RANGE}
if j < 0.0 and cy > 0.0:
    v = cy / -j
    e = v if v < e else e
for l, m, n, c, u, t, half in boxes#:
    l = cx - l
    m = cy - m
    n = cz - n
    v = ((c if k < 0.0 else -c) - n) / k if k > 1e-12 or k < -1e-12 else -1.0
    f = l + v * i
    g = m + v * j
    if v <= 0.0 or f * f > u or g * g > t:
        v = meet_box(l, m, n, i, j, k, half)
    e = v if v < e else e
for meet in others#:
    v = meet(cx, cy, cz, i, j, k)
    e = v if v < e else e"""


def ray_lines(number: int, kept: dict[str, Any]) -> Iterator[str]:
    """Lines that find the distance from the place cx, cy, cz along the unit vector i, j, k to the
    first surface as `e`, m; `RANGE` if there is none before.

    What the place is inside of does not count. The lines use `look` of `Rays` and `meet_box`. They
    keep what they found last, and the room where nothing else is: most rays stay in one room.

    Args:
        number: That of the sensor.
        kept: What lines keep, by name; to add to.
    """
    sides = (f"{side}{number}" for side in ("left", "low", "back", "right", "high", "front"))
    kept |= {**dict.fromkeys(sides, nan), f"boxes{number}": (), f"others{number}": ()}
    yield from _RAY.replace("#", str(number)).splitlines()


class Rays:
    """The boxes and spheres of a scene; cylinders and cones count as boxes."""

    def __init__(self, scene: Scene, world: World) -> None:
        """Keep what bounds what does not move; what moves is asked for."""
        fixed = [item for item in scene.objects if not item.mass]
        self._fixed = [_Shape(item, world) for item in fixed]
        self._faces: Array = np.array([_bounds(item) for item in fixed]).reshape(-1, 6)
        self._moving = [_Shape(item, world).meet for item in scene.moving]

    def look(self, *ends: float) -> tuple[Any, ...]:
        """What a ray with these ends, 6 numbers, may meet, and any other ray in the same room.

        Returns:
            The lower and the upper corner of the room, m; boxes that are not turned, each as in
            `_Shape.plain`; and what gives the distance to each other object.
        """
        pairs = [*zip(ends[:3], ends[3:], strict=True)]
        gaps = np.array([*map(min, pairs), *(-max(pair) for pair in pairs)]) - self._faces
        apart = (gaps == gaps.max(axis=1, keepdims=True)) & (gaps > 0.0)
        sides = np.where(apart, self._faces, -inf).max(axis=0, initial=-inf).tolist()
        near = [self._fixed[i] for i in np.flatnonzero(~apart.any(axis=1)).tolist()]
        boxes = [shape.plain for shape in near if shape.plain]
        others = [shape.meet for shape in near if not shape.plain] + self._moving
        return *sides[:3], *(-side for side in sides[3:]), boxes, others


def _bounds(item: SceneObject) -> tuple[float, ...]:
    """What an object that does not move is in: its upper corner, and minus its lower corner."""
    sides = item.size if item.rotation is IDENTITY else (length(item.size),) * 3
    i, j, k = (side / 2 + SLACK for side in sides)
    x, y, z = item.position
    return x + i, y + j, z + k, i - x, j - y, k - z


class _Shape:
    """An object, as rays meet it."""

    def __init__(self, item: SceneObject, world: World) -> None:
        x, y, z = item.size
        self._name, self._world, self._moves = item.name, world, item.mass > 0
        self._place, self._half = item.position, (x / 2, y / 2, z / 2)
        self._back = inverse(item.rotation)
        self._balanced, self._sphere = item.balance == (0.0, 0.0, 0.0), item.shape == "sphere"
        self.plain: tuple[Any, ...] = ()
        """Of a box that is not turned: its centre, how far its faces along z are from there, the
        squares of how far their inner part reaches along x and y, and half of its size."""
        if item.rotation is IDENTITY and not self._sphere:
            self.plain = *item.position, z / 2, INNER * x * x / 4, INNER * y * y / 4, self._half

    def meet(self, x: float, y: float, z: float, u: float, v: float, w: float) -> float:
        """Distance from a place along a unit vector to the surface, both turned back first as
        `rotate_vector` does; written out, as are those of boxes."""
        if self._moves:
            i, k, j, a, c, b, d, _, _, _, _, _, _ = self._world.row(self._name)
            if not self._balanced:
                i, j, k = self._world.centre(self._name)
        else:
            (i, j, k), (a, b, c, d) = self._place, self._back
        x, y, z = x - i, y - j, z - k
        if self._sphere:
            return _meet_sphere((x, y, z), (u, v, w), self._half[0])
        i, j, k = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
        p, q, r = 2.0 * (b * w - c * v), 2.0 * (c * u - a * w), 2.0 * (a * v - b * u)
        return meet_box(
            x + d * i + b * k - c * j,
            y + d * j + c * i - a * k,
            z + d * k + a * j - b * i,
            u + d * p + b * r - c * q,
            v + d * q + c * p - a * r,
            w + d * r + a * q - b * p,
            self._half,
        )


def _meet_sphere(start: Vec3, way: Vec3, radius: float) -> float:
    along = -dot(start, way)
    square = radius * radius - dot(start, start) + along * along
    distance = along - sqrt(square) if square >= 0.0 else -1.0
    return distance if distance >= 0.0 else inf


def meet_box(x: float, y: float, z: float, u: float, v: float, w: float, half: Vec3) -> float:
    """Distance to a box at the origin; the order of axes changes no bit."""
    wide, high, long = half
    if v * v > w * w:
        y, z, v, w, high, long = z, y, w, v, long, high
    if w > 1e-12:
        near, far = (-long - z) / w, (long - z) / w
    elif w < -1e-12:
        near, far = (long - z) / w, (-long - z) / w
    elif -long <= z <= long:
        near, far = -inf, inf
    else:
        return inf
    if near > 0.0:
        i, j = x + near * u, y + near * v
        if i * i < INNER * wide * wide and j * j < INNER * high * high:
            return near
    if not -1e-12 < u < 1e-12:
        face = wide if u < 0.0 else -wide
        one, other = (face - x) / u, (-face - x) / u
        near, far = one if one > near else near, other if other < far else far
        if near > far:
            return inf
    elif not -wide <= x <= wide:
        return inf
    if not -1e-12 < v < 1e-12:
        face = high if v < 0.0 else -high
        one, other = (face - y) / v, (-face - y) / v
        near, far = one if one > near else near, other if other < far else far
        if near > far:
            return inf
    elif not -high <= y <= high:
        return inf
    return near if near >= 0.0 else inf
