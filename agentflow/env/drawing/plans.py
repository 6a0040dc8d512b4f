"""Owns plans: a scene as outlines in metres, from above and from the right.

Drawing them is drawings.py's.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from agentflow.env.drawing.backdrop import CIRCLE, hull, silhouette
from agentflow.env.drawing.figures import Figures
from agentflow.env.physics.rotations import frame_of
from agentflow.env.rollout import Array
from agentflow.env.scene import Start, Thing
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import LONE_ROOT
from agentflow.machine.tree import Machine

Point = tuple[float, float]

LONG = 40.0
"""Things longer than this reach beyond the picture, m."""
BEHIND, AHEAD, ASIDE = -22.0, 45.0, 22.0
"""How far a picture follows long things along z- and z+, and along x to both sides, m."""
FARTHEST = 140.0
"""Where every picture ends along z+, m."""
MARGIN = 2.0
"""m around what is shown."""


@dataclass(frozen=True)
class Outline:
    """What one thing covers in a plan."""

    name: str
    points: tuple[Point, ...]
    """Across and upwards in the plan, m."""
    color: tuple[float, float, float, float]
    filled: bool = True
    """Things beside the section of the view from the right are only lines."""


@dataclass(frozen=True)
class Plan:
    """One view. z+ is to the right in both, so that they can stand below each other."""

    title: str
    upwards: str
    """Axis that runs upwards in the picture."""
    sign: int
    """-1 where numbers on that axis grow downwards."""
    low: Point
    high: Point
    outlines: tuple[Outline, ...]
    """Those in front come last."""
    start: tuple[Point, ...]
    """The building volume where the machine is put down."""


def plans(task: Task) -> tuple[Plan, Plan]:
    """A level from above (z to the right, x downwards) and from the right (y upwards)."""
    scene, brief = task.scene(), task.brief
    things = (*scene.things, *_given(brief.given))
    volume = _volume(scene.start, brief.size_limit)
    low, high = _frame(things, volume)
    above = Plan(
        "from above",
        "x",
        -1,
        (low[2], -high[0]),
        (high[2], -low[0]),
        tuple(_outline(thing, (2, 0), -1) for thing in sorted(things, key=_top)),
        tuple(hull(volume[:, [2, 0]] * (1, -1))),
    )
    right = Plan(
        "from the right, cut along x = 0",
        "y",
        1,
        (low[2], low[1]),
        (high[2], high[1]),
        tuple(_outline(thing, (2, 1), 1) for thing in sorted(things, key=_nearness)),
        tuple(hull(volume[:, [2, 1]])),
    )
    return above, right


def base_name(name: str) -> str:
    """What pieces of a thing, and things of a kind, have in common: "ring 1, piece 2" is "ring"."""
    return re.sub(r"[\s\d-]+$", "", name.partition(",")[0])


def _given(machine: Machine) -> list[Thing]:
    if machine == LONE_ROOT:
        return []
    figures = Figures(machine)
    names = {f"block {step.id}": library()[step.type].name for step in machine}
    return [replace(solid, name=names[solid.name]) for solid in figures.things(figures.rest)]


def _volume(start: Start, size: tuple[float, float, float]) -> Array:
    """(8, 3) corners of the building volume, as the machine is put down in it."""
    corners = silhouette(Thing("", "box", size, (0.0, size[1] / 2, 0.0)))
    turned: Array = corners @ frame_of(start.rotation) + (0.0, start.height, 0.0)
    return turned


def _frame(things: Sequence[Thing], volume: Array) -> tuple[Array, Array]:
    """Lowest and highest x, y, z of what the plans show."""
    lows, highs = [volume.min(axis=0)], [volume.max(axis=0)]
    reach = np.array([(-ASIDE, -np.inf, BEHIND), (ASIDE, np.inf, AHEAD)])
    for thing in things:
        points = _points(thing)
        low, high = points.min(axis=0), points.max(axis=0)
        if (high - low).max() > LONG:
            low, high = np.clip(low, *reach), np.clip(high, *reach)
        lows.append(low)
        highs.append(high)
    low, high = np.min(lows, axis=0) - MARGIN, np.max(highs, axis=0) + MARGIN
    low[1], high[2] = min(low[1], 0.0), min(high[2], FARTHEST)
    return low, high


def _points(thing: Thing) -> Array:
    if thing.shape != "sphere":
        return silhouette(thing)
    rim = CIRCLE * thing.size[0]
    flat = (np.insert(rim, axis, 0.0, axis=1) for axis in range(3))
    return np.concatenate(list(flat)) + thing.position


def _outline(thing: Thing, axes: tuple[int, int], sign: int) -> Outline:
    points = _points(thing)
    low, high = points[:, 0].min(), points[:, 0].max()
    beside = axes == (2, 1) and thing.mass == 0 and not low <= 0 <= high
    small = (points.max(axis=0) - points.min(axis=0)).max() < LONG / 8
    places = points[:, axes] * (1, sign)
    return Outline(thing.name, tuple(hull(places)), thing.color, small or not beside)


def _top(thing: Thing) -> float:
    return float(_points(thing)[:, 1].max())


def _nearness(thing: Thing) -> float:
    return float(_points(thing)[:, 0].max())
