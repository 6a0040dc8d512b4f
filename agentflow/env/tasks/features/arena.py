"""The throwing arena: walls, ramps and a hurdle around the machine."""

from collections.abc import Iterator
from math import cos, radians, sin

from agentflow.env.scene import SceneObject
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD, wall
from agentflow.env.tasks.knobs import knob
from agentflow.machine.geometry.vectors import Vec3, about_axis

THICK = 0.4
"""Thickness of the ramps, m."""


class Arena(Parameters):
    """Four walls around the machine."""

    distance: float = knob(11, 9, 100, "m", "distance of the walls' centres from x = z = 0")
    height: float = knob(1.5, 0, 10, "m", "height of the walls; 0 removes them")
    thickness: float = knob(0.8, 0.2, 2, "m", "thickness of the walls")

    @property
    def foot(self) -> float:
        """Distance of the ramps' lower edges from x = z = 0: the outside of the walls, m."""
        return self.distance + self.thickness / 2


class Ramps(Parameters):
    """Four ramps that rise outward, one behind each wall."""

    angle: float = knob(0, 0, 45, "degrees", "slope of the ramps; 0 removes them")
    length: float = knob(20, 2, 60, "m", "length from lower to upper edge")

    @property
    def top(self) -> float:
        """Height of the ramps' upper edges, m."""
        return self.length * sin(radians(self.angle))


class Hurdle(Parameters):
    """A wall to throw over."""

    height: float = knob(0, 0, 20, "m", "height of the wall; 0 removes it")
    at: float = knob(15, 12, 100, "m", "z of its centre")
    width: float = knob(30, 1, 100, "m", "width along x")


def arena_objects(arena: Arena, ramps: Ramps, hurdle: Hurdle) -> tuple[SceneObject, ...]:
    """Walls, ramps and hurdle."""
    size = (hurdle.width, hurdle.height, arena.thickness)
    hurdles = (wall("hurdle", 0.0, hurdle.at, size),) if hurdle.height else ()
    return (*_walls(arena), *_ramps(arena, ramps), *hurdles)


def _walls(arena: Arena) -> Iterator[SceneObject]:
    if arena.height:
        far, high, thick = arena.distance, arena.height, arena.thickness
        side: Vec3 = (thick, high, 2 * far + thick)
        end: Vec3 = (2 * far - thick, high, thick)
        yield wall("left wall", -far, 0.0, side)
        yield wall("right wall", far, 0.0, side)
        yield wall("back wall", 0.0, -far, end)
        yield wall("front wall", 0.0, far, end)


def _ramps(arena: Arena, ramps: Ramps) -> Iterator[SceneObject]:
    if not ramps.angle:
        return
    tilt, long = radians(ramps.angle), ramps.length
    out = arena.foot + long / 2 * cos(tilt) + THICK / 2 * sin(tilt)
    up = long / 2 * sin(tilt) - THICK / 2 * cos(tilt)
    wide = 2 * (arena.foot + long * cos(tilt))
    along, across = (wide, THICK, long), (long, THICK, wide)
    for name, size, place, axis in (
        ("front", along, (0.0, up, out), (-1.0, 0.0, 0.0)),
        ("back", along, (0.0, up, -out), (1.0, 0.0, 0.0)),
        ("right", across, (out, up, 0.0), (0.0, 0.0, 1.0)),
        ("left", across, (-out, up, 0.0), (0.0, 0.0, -1.0)),
    ):
        yield SceneObject(f"{name} ramp", "box", size, place, about_axis(axis, tilt), color=WOOD)
