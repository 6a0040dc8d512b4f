"""Owns the ground of a picture: lines that show distance, shadows that show height.

Both are flat outlines on a plane, painted before the solids.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.cameras import Camera, axes_of, project
from agentflow.env.drawing.raster import SUN, corners_of
from agentflow.env.physics.rotations import frame_of
from agentflow.env.rollout import Array
from agentflow.env.scene import Thing

LAND = (214, 219, 208)
LINE = (190, 197, 184)
INK = (118, 126, 114)
DARK = (30, 36, 30)
SHADE = 90
"""How much of the dark a shadow has, of 255."""
LINES = 25
"""Lines on either side of z = 0."""
SIDE_REACH, PIECES = 60.0, 49
"""How far a line goes in x, m, and of how many points it is made."""
LABEL_X = 3.5
"""Where along a line its label stands, m."""
_TURNS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1) / 2
"""Points of a circle of diameter 1."""


def backdrop(camera: Camera, solids: Sequence[Thing], spacing: float) -> Image.Image:
    """The ground as the camera sees it (RGBA), with lines every `spacing` metres along z."""
    size = (camera.width, camera.height)
    picture = Image.new("RGBA", size, LAND)
    pen = ImageDraw.Draw(picture)
    _lines(pen, camera, spacing)
    shade = Image.new("L", size, 0)
    shadow = ImageDraw.Draw(shade)
    for outline in _shadows(camera, solids):
        shadow.polygon(outline, fill=SHADE)
    area = shade.getbbox()
    if area is not None:
        picture.paste(DARK, area, shade.crop(area))
    return picture


def _lines(pen: ImageDraw.ImageDraw, camera: Camera, spacing: float) -> None:
    width = max(1, camera.height // 300)
    zs: Array = spacing * np.arange(-LINES, LINES + 1, dtype=np.float64)
    xs = np.linspace(-SIDE_REACH, SIDE_REACH, PIECES)
    points = np.stack([np.tile(xs, len(zs)), np.zeros(len(zs) * PIECES), np.repeat(zs, PIECES)], 1)
    for line in project(points, camera).reshape(len(zs), PIECES, 2):
        seen = line[_near(line, camera)]
        if len(seen) > 1:
            pen.line(seen.ravel().tolist(), fill=LINE, width=width)
    if spacing > 1.0:
        _distances(pen, camera, zs)


def _distances(pen: ImageDraw.ImageDraw, camera: Camera, zs: Array) -> None:
    """Say how far each line is, the rounder numbers first, wherever there is room."""
    font = ImageFont.load_default(size=max(10, camera.height // 32))
    places = project(np.stack([np.full(len(zs), LABEL_X), np.zeros(len(zs)), zs], axis=1), camera)
    near = _near(places, camera)
    taken: list[tuple[float, float, float, float]] = []
    for z, place in sorted(
        zip(zs[near].tolist(), places[near].tolist(), strict=True),
        key=lambda item: (item[0] % 50 != 0, item[0] % 10 != 0, item[0]),
    ):
        words = f"{z:g} m"
        left, top, right, bottom = pen.textbbox(place, words, font=font, anchor="lb")
        gap = (bottom - top) / 2
        if all(
            right + gap < other[0] or other[2] + gap < left or bottom < other[1] or other[3] < top
            for other in taken
        ):
            taken.append((left, top, right, bottom))
            pen.text(place, words, fill=INK, font=font, anchor="lb")


def _near(places: Array, camera: Camera) -> NDArray[np.bool_]:
    """Which pixels (..., 2) are before the camera and not absurdly far outside the picture."""
    with np.errstate(invalid="ignore"):
        near: NDArray[np.bool_] = np.abs(places).max(axis=-1) < 8 * camera.width
    return near


def _shadows(camera: Camera, solids: Sequence[Thing]) -> Iterator[list[tuple[float, float]]]:
    """The shadow of each solid in the picture; all solids are convex."""
    sun = np.asarray(SUN)
    for thing in solids:
        points = silhouette(thing)
        places = project(points - sun * (points[:, 1:2] / sun[1]), camera)
        if _near(places, camera).all():
            yield hull(places)


def silhouette(thing: Thing) -> Array:
    """Points of a solid between which its shadow lies."""
    if thing.shape == "sphere":
        across, upwards, _ = axes_of(np.asarray(SUN))
        points: Array = CIRCLE[:, :1] * across + CIRCLE[:, 1:] * upwards
        return points * thing.size[0] + thing.position
    if thing.shape == "box":
        return corners_of(thing)
    rim = np.insert(CIRCLE, 1, -0.5, axis=1)
    rims = np.concatenate([rim, rim * ((1, -1, 1) if thing.shape == "cylinder" else (0, -1, 0))])
    return rims * thing.size @ frame_of(thing.rotation) + thing.position


def hull(places: Array) -> list[tuple[float, float]]:
    """The outline around points of the plane, by Andrew's monotone chain."""
    points = sorted((float(x), float(y)) for x, y in places)
    outline: list[tuple[float, float]] = []
    for way in (points, points[::-1]):
        start = len(outline)
        for x, y in way:
            while len(outline) > start + 1:
                (x0, y0), (x1, y1) = outline[-2:]
                if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) > 0:
                    break
                outline.pop()
            outline.append((x, y))
        outline.pop()
    return outline
