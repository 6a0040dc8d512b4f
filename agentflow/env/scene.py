"""Owns the vocabulary of a scene: what the world holds besides the machine.

Game frame throughout: left-handed, x right, y up, z forward; metres, kilograms, seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
"""(x, y, z, w), game frame."""

IDENTITY: Quat = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Thing:
    """One object of a scene. `mass` 0 stands still for ever; anything else moves.

    `size` is the full extent along the thing's own x, y, z; a sphere's diameter is `size[0]`; a
    cylinder's and a cone's axis is y.
    """

    name: str
    shape: Literal["box", "sphere", "cylinder", "cone"]
    size: Vec3
    position: Vec3
    """Centre."""
    rotation: Quat = IDENTITY
    mass: float = 0.0
    friction: float | None = None
    """None: as the physical constants have it; so is the ground's."""
    restitution: float | None = None
    """The same."""
    color: tuple[float, float, float, float] = (0.55, 0.57, 0.6, 1.0)


@dataclass(frozen=True)
class Scene:
    """Flat ground at y = 0 and what stands on it; wind blows everywhere at one velocity."""

    things: tuple[Thing, ...] = ()
    wind: Vec3 = (0.0, 0.0, 0.0)
    """Velocity of the air, m/s."""
