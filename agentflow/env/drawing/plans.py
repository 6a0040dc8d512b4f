"""Plans of a level: outlines of its scene in metres, from above and from the right."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from agentflow.env.drawing.backdrop import CIRCLE, silhouette
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.env.scene import SceneObject, Start
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.geometry.balance import convex_hull
from agentflow.machine.tree import Machine

Point = tuple[float, float]

LONG = 40.0
"""Length above which objects may reach beyond the picture, m."""
BEHIND, AHEAD, ASIDE = -22.0, 45.0, 22.0
"""Limits of the picture for such objects: along z-, along z+, and along x to both sides, m."""
FARTHEST = 140.0
"""Largest z in any picture, m."""
MARGIN = 2.0
"""Margin around the objects, m."""


@dataclass(frozen=True)
class Outline:
    """Outline of one object in a plan: points to the right and up, m; not filled for objects beside
    the cut of the view from the right."""

    name: str
    points: tuple[Point, ...]
    color: tuple[float, float, float, float]
    filled: bool = True


@dataclass(frozen=True)
class LevelPlan:
    """One view of a level, whose outlines are from back to front; z+ is to the right.

    The axis `upwards` runs upwards in the picture; `sign` is -1 if its numbers grow downwards.
    `start` is the building volume at the machine's start.
    """

    title: str
    upwards: str
    sign: int
    low: Point
    high: Point
    outlines: tuple[Outline, ...]
    start: tuple[Point, ...]


def level_plans(task: Task) -> tuple[LevelPlan, LevelPlan]:
    """A level from above (z to the right, x downwards) and from the right (y upwards)."""
    scene, brief = task.scene(), task.brief
    objects = (*scene.objects, *_given(brief.given))
    volume = _volume(scene.start, brief.limits.size)
    low, high = frame_of(objects, volume)
    by_height = sorted(objects, key=lambda item: _points(item)[:, 1].max())
    by_nearness = sorted(objects, key=lambda item: _points(item)[:, 0].max())
    above = LevelPlan(
        "from above",
        "x",
        -1,
        (low[2], -high[0]),
        (high[2], -low[0]),
        tuple(_outline(item, (2, 0), -1) for item in by_height),
        _hull(volume[:, [2, 0]] * (1, -1)),
    )
    right = LevelPlan(
        "from the right, cut along x = 0",
        "y",
        1,
        (low[2], low[1]),
        (high[2], high[1]),
        tuple(_outline(item, (2, 1), 1) for item in by_nearness),
        _hull(volume[:, [2, 1]]),
    )
    return above, right


def base_name(name: str) -> str:
    """Name of an object without numbers and pieces: "ring 1, piece 2" -> "ring"."""
    return re.sub(r"[\s\d-]+$", "", name.partition(",")[0])


def _hull(places: Array) -> tuple[Point, ...]:
    return tuple(convex_hull((x, y) for x, y in places.tolist()))


def _given(machine: Machine) -> list[SceneObject]:
    if machine == LONE_ROOT:
        return []
    shapes = MachineSolids(machine)
    names = {f"block {step.id}": library()[step.type].name for step in machine}
    return [replace(solid, name=names[solid.name]) for solid in shapes.objects(shapes.rest)]


def _volume(start: Start, size: tuple[float, float, float]) -> Array:
    """(8, 3) corners of the building volume at the machine's start."""
    corners = silhouette(SceneObject("", "box", size, (0.0, size[1] / 2, 0.0)))
    turned: Array = corners @ rotated_axes(start.rotation) + (0.0, start.height, 0.0)
    return turned


def frame_of(objects: Sequence[SceneObject], volume: Array) -> tuple[Array, Array]:
    """Lowest and highest (x, y, z) that pictures of a level show, with points that are in them."""
    lows, highs = [volume.min(axis=0)], [volume.max(axis=0)]
    reach = np.array([(-ASIDE, -np.inf, BEHIND), (ASIDE, np.inf, AHEAD)])
    for item in objects:
        points = _points(item)
        low, high = points.min(axis=0), points.max(axis=0)
        if (high - low).max() > LONG:
            low, high = np.clip(low, *reach), np.clip(high, *reach)
        lows.append(low)
        highs.append(high)
    low, high = np.min(lows, axis=0) - MARGIN, np.max(highs, axis=0) + MARGIN
    low[1], high[2] = min(low[1], 0.0), min(high[2], FARTHEST)
    return low, high


def _points(item: SceneObject) -> Array:
    if item.shape != "sphere":
        return silhouette(item)
    rim = CIRCLE * item.size[0]
    flat = (np.insert(rim, axis, 0.0, axis=1) for axis in range(3))
    return np.concatenate(list(flat)) + item.position


def _outline(item: SceneObject, axes: tuple[int, int], sign: int) -> Outline:
    points = _points(item)
    low, high = points[:, 0].min(), points[:, 0].max()
    beside = axes == (2, 1) and item.mass == 0 and not low <= 0 <= high
    small = (points.max(axis=0) - points.min(axis=0)).max() < LONG / 8
    places = points[:, axes] * (1, sign)
    return Outline(item.name, _hull(places), item.color, small or not beside)
