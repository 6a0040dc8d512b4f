"""Scenes: everything in the world but the machine.

Game frame throughout: left-handed, x right, y up, z forward; metres, kilograms, seconds.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import pi, radians, sin
from typing import Literal

from agentflow.machine.geometry.vectors import IDENTITY, Quat, Vec3, about_axis, product

Body = int | str
"""A block id, the name of a scene object, or "ground"."""


def blocks_among(bodies: Iterable[Body]) -> list[int]:
    """The ids of blocks, ascending."""
    return sorted(body for body in bodies if isinstance(body, int))


def objects_among(bodies: Iterable[Body]) -> list[str]:
    """The names of scene objects and the ground, in order."""
    return sorted(body for body in bodies if isinstance(body, str))


@dataclass(frozen=True)
class SceneObject:
    """One object of a scene. With `mass` 0 it never moves.

    `size` is the full extent along the object's own x, y, z; a sphere's diameter is `size[0]`; a
    cylinder's and a cone's axis is y.
    """

    name: str
    """Its name, different from those of the other objects of the scene."""
    shape: Literal["box", "sphere", "cylinder", "cone"]
    """Its shape."""
    size: Vec3
    """Full extent, m."""
    position: Vec3
    """Centre."""
    rotation: Quat = IDENTITY
    """Quaternion x, y, z, w."""
    mass: float = 0.0
    """Mass in kg; 0 keeps it in place."""
    load: float = 0.0
    """Mass that it gains as the schedule's entry `loads` goes from 0 to 1, kg."""
    friction: float | None = None
    """None: the value of the physical constants, which is also the ground's."""
    restitution: float | None = None
    """None: as for friction."""
    stiffness: float | None = None
    """Force over depth of each point where something touches it, N/m; None: hard."""
    balance: Vec3 = (0.0, 0.0, 0.0)
    """From its centre to its centre of mass, along its own axes, m. If not 0, its inertia about its
    centre of mass is that of a uniform box of its size about the middle."""
    held: bool = False
    """Whether it is held where it is until the schedule's entry `holds` is at 1."""
    color: tuple[float, float, float, float] = (0.55, 0.57, 0.6, 1.0)
    """Red, green, blue and opacity, each from 0 to 1."""


def _form(item: SceneObject, side: Literal[1, -1]) -> tuple[object, ...]:
    """What an object is, or its mirror image in the plane x = 0 for side -1."""
    (x, y, z), (i, j, k, w) = item.position, item.rotation
    turned = (i, side * j, side * k, w)
    sign = -1 if next((value for value in reversed(turned) if abs(value) > 1e-9), 1) < 0 else 1
    rotation = tuple(round(sign * value, 9) + 0.0 for value in turned)
    place = (round(side * x, 9) + 0.0, y, z)
    balance = (side * item.balance[0] + 0.0, *item.balance[1:])
    same = replace(item, name="", color=(0, 0, 0, 0), position=place, balance=balance)
    return *(value for name, value in vars(same).items() if name != "rotation"), rotation


@dataclass(frozen=True)
class Start:
    """Where the machine starts: on a plane through (0, `height`, 0), m, tilted with it.

    Level, its lowest point is on the plane, the centre of its bounding box is over x = z = 0, and
    its front is turned towards x+ by `yaw` degrees. Then the plane's z+ end is raised by `pitch`
    degrees.
    """

    height: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0

    @property
    def rotation(self) -> Quat:
        """First the yaw, then the pitch."""
        yaw = about_axis((0.0, 1.0, 0.0), radians(self.yaw))
        return product(about_axis((-1.0, 0.0, 0.0), radians(self.pitch)), yaw)


@dataclass(frozen=True)
class Gust:
    """One wave in the strength of the wind: its amplitude as a share of the mean wind, its period
    (s), and its phase at t = 0 (rad)."""

    share: float
    period: float
    phase: float


@dataclass(frozen=True)
class Scene:
    """Flat ground at y = 0, objects on it, and wind that is the same everywhere."""

    objects: tuple[SceneObject, ...] = ()
    """Everything in the scene but the machine and the ground."""
    wind: Vec3 = (0.0, 0.0, 0.0)
    """Mean velocity of the air from t = 0 on, m/s; still before."""
    gusts: tuple[Gust, ...] = ()
    """Changes in the wind's strength from t = 0 on; its direction stays."""
    start: Start = field(default_factory=Start)
    """Where the machine starts."""
    friction: float | None = None
    """Of the ground; None: the value of the physical constants."""
    target: Vec3 = (0.0, 0.0, 0.0)
    """Where sensors of the target point, m."""
    machine_held: bool = False
    """Whether every block of the machine is held until the entry `holds` is at 1."""

    @property
    def moving(self) -> tuple[SceneObject, ...]:
        """The objects that can move."""
        return tuple(item for item in self.objects if item.mass > 0)

    @property
    def symmetric(self) -> bool:
        """Whether it is its own mirror image in the plane x = 0, but for names and colours."""
        objects = {_form(item, 1) for item in self.objects}
        images = {_form(item, -1) for item in self.objects}
        return objects == images and not self.wind[0] and not (self.start.yaw or self.target[0])

    def loaded(self, share: float) -> Scene:
        """The scene with this share of their loads on all objects."""
        objects = (replace(item, mass=item.mass + share * item.load) for item in self.objects)
        return replace(self, objects=tuple(objects))

    def strength(self, time: float) -> float:
        """Strength of the wind at a time (s since t = 0), as a share of the mean wind."""
        return 1.0 + sum(
            gust.share * sin(2 * pi * time / gust.period + gust.phase) for gust in self.gusts
        )
