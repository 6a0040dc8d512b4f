"""Cameras that fit points into a picture, and projection. Game frame: left-handed, y up."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import radians, tan

import numpy as np

from agentflow.env.rollout import Array
from agentflow.machine.geometry.vectors import Vec3

Size = tuple[int, int]
"""Width and height in pixels."""
THREE_QUARTER = (0.72, 0.42, -0.62)
"""Direction from a machine to the eye: right, above and behind, so that z+ leads into the picture
and to the right."""
SIDE = (0.9, 0.3, -0.35)
"""Direction from farther right, so that distance along z+ shows as width."""
VIEWS: dict[str, Vec3] = {
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 1.0, -1e-6),
    "three-quarter": THREE_QUARTER,
}
"""Directions from a machine to the eye; the top view has z+ at its upper edge."""
SUN = (-4.0, 12.0, -7.0)
"""Direction towards the light, game frame."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, game frame. Its field of view is vertical, degrees; `sun` is the direction
    towards the light."""

    eye: Vec3
    target: Vec3
    width: int = 640
    height: int = 480
    field_of_view: float = 45.0
    sun: Vec3 = SUN

    @cached_property
    def axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors to the right, up and towards the eye."""
        return axes_of(np.subtract(self.eye, self.target))

    @property
    def focal_length(self) -> float:
        """Focal length in pixels."""
        return self.height / 2 / tan(radians(self.field_of_view) / 2)


@dataclass(frozen=True)
class View:
    """A viewing direction, a picture size, and how much of the picture to fill.

    The field of view is vertical, degrees. `fill` is the share of the picture's width or height
    that the points may fill, `below` the share of its height, at its lower edge, that is for
    something else.
    """

    back: tuple[float, float, float] = THREE_QUARTER
    size: Size = (800, 600)
    field_of_view: float = 30.0
    fill: float = 0.82
    below: float = 0.0


def axes_of(back: Array) -> tuple[Array, Array, Array]:
    """Unit vectors to the right, up and towards the eye of a camera that looks along -back."""
    towards = back / np.linalg.norm(back)
    right = np.cross((0.0, 1.0, 0.0), -towards)
    right /= np.linalg.norm(right)
    return right, np.cross(-towards, right), towards


def fit(
    points: Array, view: View, nearest: float = 6.0, at: Array | None = None
) -> tuple[Array, float]:
    """Target (3,) and smallest distance at which all points are in the picture, m.

    Args:
        points: (K, 3), m.
        view: Direction and picture.
        nearest: Minimum distance, m.
        at: The target, if it is given.
    """
    right, up, towards = axes_of(np.asarray(view.back, dtype=np.float64))
    across = np.stack([points @ right, points @ up, points @ towards], axis=1)
    middle = (across.min(axis=0) + across.max(axis=0)) / 2
    if at is not None:
        middle = np.array([at @ right, at @ up, at @ towards])
    rest = np.abs(across - middle)
    slope = tan(radians(view.field_of_view) / 2) * view.fill
    aspect = view.size[0] / view.size[1]
    tall = slope * (1.0 - view.below)
    needed = np.maximum(rest[:, 0] / (slope * aspect), rest[:, 1] / tall)
    distance = float((needed + across[:, 2] - middle[2]).max())
    target = middle[0] * right + middle[1] * up + middle[2] * towards
    return target, max(nearest, distance)


def camera_at(target: Array, distance: float, view: View) -> Camera:
    """The camera of a view at a distance from its target."""
    _, up, towards = axes_of(np.asarray(view.back, dtype=np.float64))
    target = target - up * (view.below * distance * tan(radians(view.field_of_view) / 2))
    eye = target + distance * towards
    return Camera(to_vec3(eye), to_vec3(target), *view.size, view.field_of_view)


def lit(camera: Camera) -> Camera:
    """The camera with light from where it comes in the three-quarter view: whatever side of a
    machine is seen is then equally bright."""
    sun = np.asarray(axes_of(np.asarray(THREE_QUARTER))) @ SUN @ np.asarray(camera.axes)
    return replace(camera, sun=to_vec3(sun))


def to_vec3(values: Array) -> Vec3:
    """Three numbers as a tuple."""
    return (float(values[0]), float(values[1]), float(values[2]))


def project(points: Array, camera: Camera) -> Array:
    """Project (K, 3) points to (K, 2) pixels; nan behind the camera."""
    right, up, towards = camera.axes
    seen = points - np.asarray(camera.eye)
    depth = -(seen @ towards)
    depth = np.where(depth > 0.01, depth, np.nan)
    x = camera.width / 2 + camera.focal_length * (seen @ right) / depth
    y = camera.height / 2 - camera.focal_length * (seen @ up) / depth
    return np.stack([x, y], axis=1)
