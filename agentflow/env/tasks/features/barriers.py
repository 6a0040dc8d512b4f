"""Obstacles to jump over: walls, or a trench between banks, and a slope before them."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, radians, sin, tan

from agentflow.env.scene import Thing, Vec3
from agentflow.env.tasks.base import Parameters
from agentflow.env.tasks.family import WOOD, wall
from agentflow.env.tasks.knobs import knob

WIDTH = 60.0
"""Extent of every obstacle along x, m: too wide to go around."""
BANK_BACK, BANK_AHEAD = 25.0, 150.0
"""Extent of the banks behind z = 0 and beyond the trench, m."""
LIP = 0.15
"""Gap between the top of a trench's far wall and the bank, m; lets machines land on the edge."""
SKIN = 0.02
"""How far the far wall juts out from its bank, so that it is touched first, m."""
PLATE = 0.2
"""Thickness of the slope, m."""


class Walls(Parameters):
    """Upright walls across z+."""

    count: int = knob(1, 1, 5, "", "number of walls")
    first: float = knob(12, 9.5, 50, "m", "z of the first wall's middle")
    spacing: float = knob(12, 1.5, 50, "m", "distance between walls")
    height: float = knob(0.5, 0.1, 5, "m", "height of the walls")
    thickness: float = knob(0.5, 0.1, 2, "m", "thickness of the walls")


class Trench(Parameters):
    """A trench across z+; it replaces the walls, and the machine starts on its near bank."""

    length: float = knob(0, 0, 20, "m", "width from bank to bank; 0 removes it")
    depth: float = knob(3, 1, 10, "m", "depth")
    at: float = knob(15, 12, 50, "m", "z of its middle")


class Slope(Parameters):
    """A slope that rises towards the first obstacle."""

    angle: float = knob(0, 0, 30, "degrees", "steepness; 0 removes it")
    length: float = knob(3, 1, 10, "m", "length along z")
    before: float = knob(0, 0, 10, "m", "distance from its upper edge to the first obstacle")


def near_side(walls: Walls, trench: Trench) -> float:
    """z of the near side of the first obstacle, m."""
    return trench.at - trench.length / 2 if trench.length else walls.first - walls.thickness / 2


def far_side(walls: Walls, trench: Trench) -> float:
    """z of the far side of the last obstacle, m."""
    if trench.length:
        return trench.at + trench.length / 2
    return walls.first + (walls.count - 1) * walls.spacing + walls.thickness / 2


def obstacle_names(walls: Walls, trench: Trench) -> tuple[str, ...]:
    """Names of the objects that no block may touch."""
    if trench.length:
        return ("ground", "far wall")
    return tuple(f"wall {index}" for index in range(1, walls.count + 1))


def barrier_things(
    walls: Walls, trench: Trench, slope: Slope, friction: float
) -> tuple[Thing, ...]:
    """Walls or trench, and the slope."""
    solids = _banks(trench, friction) if trench.length else _walls(walls, friction)
    base = trench.depth if trench.length else 0.0
    return (*solids, *_slope(slope, near_side(walls, trench) - slope.before, base, friction))


def _walls(walls: Walls, friction: float) -> Iterator[Thing]:
    for index in range(walls.count):
        z = walls.first + index * walls.spacing
        size: Vec3 = (WIDTH, walls.height, walls.thickness)
        yield wall(f"wall {index + 1}", 0.0, z, size, friction)


def _banks(trench: Trench, friction: float) -> Iterator[Thing]:
    near, far = trench.at - trench.length / 2, trench.at + trench.length / 2
    long = near + BANK_BACK
    yield wall("near bank", 0.0, near - long / 2, (WIDTH, trench.depth, long), friction)
    ahead: Vec3 = (WIDTH, trench.depth, BANK_AHEAD)
    yield wall("far bank", 0.0, far + BANK_AHEAD / 2, ahead, friction)
    size: Vec3 = (WIDTH, trench.depth - LIP, 2 * SKIN)
    yield wall("far wall", 0.0, far, size, friction)


def _slope(slope: Slope, edge: float, base: float, friction: float) -> Iterator[Thing]:
    """A plate whose surface rises to its upper edge at z = `edge`."""
    if not slope.angle:
        return
    pitch = radians(slope.angle)
    rise, run = slope.length * tan(pitch), slope.length
    middle = (
        0.0,
        base + rise / 2 - PLATE / 2 * cos(pitch),
        edge - run / 2 + PLATE / 2 * sin(pitch),
    )
    size = (WIDTH, PLATE, run / cos(pitch))
    turned = (-sin(pitch / 2), 0.0, 0.0, cos(pitch / 2))
    yield Thing("slope", "box", size, middle, turned, friction=friction, color=WOOD)


def barrier_sentences(walls: Walls, trench: Trench, slope: Slope) -> tuple[str, ...]:
    """Describe walls or trench, and the slope, to designers."""
    sentences = _trench_sentences(trench) if trench.length else _wall_sentences(walls)
    if not slope.angle:
        return sentences
    edge = near_side(walls, trench) - slope.before
    rise = slope.length * tan(radians(slope.angle))
    return (
        *sentences,
        f"A slope of {slope.angle:g} degrees rises from z = {edge - slope.length:g} m to its edge "
        f"at z = {edge:g} m, {rise:.2f} m higher; it moves with the obstacle.",
    )


def _wall_sentences(walls: Walls) -> tuple[str, ...]:
    return tuple(
        f"A wall stands across the path with its middle at z = "
        f"{walls.first + index * walls.spacing:g} m: {walls.height:g} m high, "
        f"{walls.thickness:g} m thick, {WIDTH:g} m wide."
        for index in range(walls.count)
    )


def _trench_sentences(trench: Trench) -> tuple[str, ...]:
    near, far = trench.at - trench.length / 2, trench.at + trench.length / 2
    return (
        f"A trench lies across the path from z = {near:g} m to z = {far:g} m: {trench.length:g} m "
        f"long, {trench.depth:g} m deep, {WIDTH:g} m wide; the far bank is as high as the near "
        "bank, on which the machine stands.",
    )
