"""Owns the solids that levels put in a machine's way, made of a scene's simple shapes."""

from __future__ import annotations

from collections.abc import Iterator
from math import asin, atan2, cos, hypot, pi, sin

from agentflow.env.scene import Thing
from agentflow.env.tasks.family import WOOD

FACETS = 8
"""Flat pieces of a curved surface."""
PLATE = 0.4
"""Thickness of a curved surface, m."""


def bump(name: str, z: float, height: float, length: float, width: float) -> Thing:
    """A segment of a cylinder across the road: `height` above the ground, `length` along z, m."""
    radius = (length**2 / 4 + height**2) / (2 * height)
    across = (0.0, 0.0, sin(pi / 4), cos(pi / 4))
    size = (2 * radius, width, 2 * radius)
    return Thing(name, "cylinder", size, (0.0, height - radius, z), across, color=WOOD)


def quarter_pipe(
    name: str, z: float, height: float, length: float, width: float
) -> Iterator[Thing]:
    """A ramp that starts flat and steepens along z+; open behind.

    Args:
        z: Middle of its ground plan, m.
        height: Of its upper edge, m.
        length: Along z, m.
        width: Along x, m.
    """
    radius = (length**2 + height**2) / (2 * height)
    steepest = asin(length / radius) if height <= radius else pi - asin(length / radius)
    bends = [steepest * index / FACETS for index in range(FACETS + 1)]
    edge = [(z - length / 2 + radius * sin(a), radius * (1 - cos(a))) for a in bends]
    for index in range(FACETS):
        (z0, y0), (z1, y1) = edge[index], edge[index + 1]
        pitch = atan2(y1 - y0, z1 - z0)
        middle = (
            0.0,
            (y0 + y1) / 2 - PLATE / 2 * cos(pitch),
            (z0 + z1) / 2 + PLATE / 2 * sin(pitch),
        )
        turned = (-sin(pitch / 2), 0.0, 0.0, cos(pitch / 2))
        size = (width, PLATE, hypot(z1 - z0, y1 - y0))
        yield Thing(f"{name} {index}", "box", size, middle, turned, color=WOOD)
