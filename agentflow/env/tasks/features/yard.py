"""Owns the place where machines throw: walls, ramps, a hurdle, and the sentences that tell them."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, radians, sin

from agentflow.env.scene import Thing, Vec3
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD, wall
from agentflow.env.tasks.knobs import knob

THICK = 0.4
"""Of a ramp's plate, m."""


class Yard(Parameters):
    """The four walls around the machine."""

    distance: float = knob(11, 9, 100, "m", "distance of the walls' centres from x = z = 0")
    height: float = knob(1.5, 0, 10, "m", "height of the walls; 0 removes them")
    thickness: float = knob(0.8, 0.2, 2, "m", "thickness of the walls")


class Ramps(Parameters):
    """Four ramps that rise outward, one behind each wall."""

    angle: float = knob(0, 0, 45, "degrees", "by which they rise outward; 0 removes them")
    length: float = knob(20, 2, 60, "m", "from their lower to their upper edge")


class Hurdle(Parameters):
    """A wall that has to be thrown over."""

    height: float = knob(0, 0, 20, "m", "height of the wall; 0 removes it")
    at: float = knob(15, 12, 100, "m", "z of its centre")
    width: float = knob(30, 1, 100, "m", "how wide it is along x")


def yard_things(yard: Yard, ramps: Ramps, hurdle: Hurdle) -> tuple[Thing, ...]:
    """What stands around the machine."""
    return (*_walls(yard), *_ramps(yard, ramps), *_hurdle(yard, hurdle))


def yard_sentences(yard: Yard, ramps: Ramps, hurdle: Hurdle) -> Iterator[str]:
    """The same in words."""
    if yard.height:
        yield (
            f"Walls stand around the machine at x = -{yard.distance:g}, x = {yard.distance:g}, "
            f"z = -{yard.distance:g} and z = {yard.distance:g} m, {yard.height:g} m high and "
            f"{yard.thickness:g} m thick."
        )
    if ramps.angle:
        top = ramps.length * sin(radians(ramps.angle))
        yield (
            f"Ramps surround them on all four sides: from the ground at {_foot(yard):g} m from "
            f"x = z = 0 they rise outward by {ramps.angle:g} degrees over {ramps.length:g} m, to a "
            f"height of {top:.1f} m; to touch one is to land."
        )
    if hurdle.height:
        yield (
            f"A wall {hurdle.height:g} m high, {hurdle.width:g} m wide and {yard.thickness:g} m "
            f"thick stands across z+ at z = {hurdle.at:g} m."
        )


def _walls(yard: Yard) -> tuple[Thing, ...]:
    if not yard.height:
        return ()
    far, high, thick = yard.distance, yard.height, yard.thickness
    side: Vec3 = (thick, high, 2 * far + thick)
    end: Vec3 = (2 * far - thick, high, thick)
    return (
        wall("left wall", -far, 0.0, side),
        wall("right wall", far, 0.0, side),
        wall("back wall", 0.0, -far, end),
        wall("front wall", 0.0, far, end),
    )


def _foot(yard: Yard) -> float:
    """Where ramps begin, m from x = z = 0: at the outside of the walls."""
    return yard.distance + yard.thickness / 2


def _ramps(yard: Yard, ramps: Ramps) -> Iterator[Thing]:
    if not ramps.angle:
        return
    tilt = radians(ramps.angle)
    out = _foot(yard) + ramps.length / 2 * cos(tilt) + THICK / 2 * sin(tilt)
    up = ramps.length / 2 * sin(tilt) - THICK / 2 * cos(tilt)
    wide = 2 * (_foot(yard) + ramps.length * cos(tilt))
    across, half = (sin(tilt / 2), cos(tilt / 2)), ramps.length
    for name, sign in (("front", 1.0), ("back", -1.0)):
        turn = (-sign * across[0], 0.0, 0.0, across[1])
        yield Thing(
            f"{name} ramp", "box", (wide, THICK, half), (0.0, up, sign * out), turn, color=WOOD
        )
    for name, sign in (("right", 1.0), ("left", -1.0)):
        turn = (0.0, 0.0, sign * across[0], across[1])
        yield Thing(
            f"{name} ramp", "box", (half, THICK, wide), (sign * out, up, 0.0), turn, color=WOOD
        )


def _hurdle(yard: Yard, hurdle: Hurdle) -> Iterator[Thing]:
    if hurdle.height:
        size = (hurdle.width, hurdle.height, yard.thickness)
        yield wall("hurdle", 0.0, hurdle.at, size)
