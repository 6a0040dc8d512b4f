"""The ground of a picture: distance lines, their labels, and shadows of the solids."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.cameras import Camera, axes_of, project
from agentflow.env.drawing.raster import SUN, corners_of
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.env.scene import SceneObject


@dataclass(frozen=True)
class Ground:
    """Colours of what is behind a machine."""

    land: tuple[int, int, int]
    line: tuple[int, int, int]
    """Of the distance lines."""
    ink: tuple[int, int, int]
    """Of their labels."""
    square: bool = False
    """Whether thin lines run along z as well."""
    bare: bool = False
    """Whether there are neither lines nor shadows, which exact sides would turn to bars."""


SCREEN = Ground((214, 219, 208), (190, 197, 184), (118, 126, 114))
FILM = replace(SCREEN, square=True)
PAPER = Ground((255, 255, 255), (228, 228, 228), (96, 96, 96), square=True)
DARK = (30, 36, 30)
SHADE = 90
"""Opacity of a shadow, of 255."""
LINES = 25
"""Lines on either side of the camera's target."""
COARSER = (1, 2, 4, 10, 20)
"""Factors by which the lines may be farther apart."""
REACH = 0.6
"""How far the lines must reach to either side, in distances between eye and target."""
WIDE = 10.0
"""As far as they must reach for a camera of a very narrow field of view, in half heights of what it
sees."""
SIDE_REACH, PIECES = 60.0, 49
"""Least half length of a line along x (m), and its number of points."""
LABEL_X = 3.5
"""x of the labels, m."""
_TURNS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1) / 2
"""(24, 2) points of a circle of diameter 1."""


def backdrop(
    camera: Camera,
    solids: Sequence[SceneObject],
    spacing: float,
    ground: Ground = SCREEN,
    origin: float = 0.0,
) -> Image.Image:
    """Draw the ground (RGBA) with lines every `spacing` metres from z = `origin` (m), fewer far
    away."""
    size = (camera.width, camera.height)
    picture = Image.new("RGBA", size, ground.land)
    if ground.bare:
        return picture
    pen = ImageDraw.Draw(picture)
    _lines(pen, camera, spacing, ground, origin)
    shade = Image.new("L", size, 0)
    shadow = ImageDraw.Draw(shade)
    for outline in _shadows(camera, solids):
        shadow.polygon(outline, fill=SHADE)
    area = shade.getbbox()
    if area is not None:
        picture.paste(DARK, area, shade.crop(area))
    return picture


def _lines(
    pen: ImageDraw.ImageDraw, camera: Camera, spacing: float, ground: Ground, origin: float
) -> None:
    width = max(1, camera.height // (600 if ground.square else 300))
    away = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    half = away * camera.height / (2 * camera.focal_length)
    reach = REACH * min(away, WIDE * half)
    step = spacing * next((n for n in COARSER if LINES * spacing * n >= reach), COARSER[-1])
    count: Array = np.arange(-LINES, LINES + 1, dtype=np.float64)
    zs: Array = origin + step * (round((camera.target[2] - origin) / step) + count)
    xs: Array = step * (round(camera.target[0] / step) + count)
    side = max(SIDE_REACH, reach)
    along = np.linspace(-side, side, PIECES)
    for places, turned in ((zs, False), *([(xs, True)] if ground.square else [])):
        ends = np.tile(along + (camera.target[2] if turned else 0.0), len(places))
        pair = [ends, np.zeros(len(ends)), np.repeat(places, PIECES)]
        points = np.stack(pair[::-1] if turned else pair, axis=1)
        for line in project(points, camera).reshape(len(places), PIECES, 2):
            seen = line[_in_range(line, camera)]
            if len(seen) > 1:
                pen.line(seen.ravel().tolist(), fill=ground.line, width=width)
    if spacing > 1.0:
        _distances(pen, camera, zs, ground, origin)


def _distances(
    pen: ImageDraw.ImageDraw, camera: Camera, zs: Array, ground: Ground, origin: float
) -> None:
    """Label lines with their distance from `origin` where there is room, round numbers first."""
    font = ImageFont.load_default(size=max(10, camera.height // 32))
    places = project(np.stack([np.full(len(zs), LABEL_X), np.zeros(len(zs)), zs], axis=1), camera)
    near = _in_range(places, camera)
    taken: list[tuple[float, float, float, float]] = []
    for z, place in sorted(
        zip((zs[near] - origin).round(6).tolist(), places[near].tolist(), strict=True),
        key=lambda item: (item[0] % 50 != 0, item[0] % 10 != 0, item[0]),
    ):
        words = f"{z:g} m"
        left, top, right, bottom = pen.textbbox(place, words, font=font, anchor="lt")
        gap = (bottom - top) / 2
        if all(
            right + gap < other[0] or other[2] + gap < left or bottom < other[1] or other[3] < top
            for other in taken
        ):
            taken.append((left, top, right, bottom))
            pen.text(place, words, fill=ground.ink, font=font, anchor="lt")


def _in_range(places: Array, camera: Camera) -> NDArray[np.bool_]:
    """Mask of the pixels (..., 2) in front of the camera and not far outside the picture."""
    with np.errstate(invalid="ignore"):
        near: NDArray[np.bool_] = np.abs(places).max(axis=-1) < 8 * camera.width
    return near


def _shadows(camera: Camera, solids: Sequence[SceneObject]) -> Iterator[list[tuple[float, float]]]:
    """Outline of each solid's shadow in the picture; all solids are convex."""
    sun = np.asarray(SUN)
    for item in solids:
        points = silhouette(item)
        places = project(points - sun * (points[:, 1:2] / sun[1]), camera)
        if _in_range(places, camera).all():
            yield convex_hull(places)


def silhouette(item: SceneObject) -> Array:
    """(K, 3) points of a solid whose projections span its shadow."""
    if item.shape == "sphere":
        across, upwards, _ = axes_of(np.asarray(SUN))
        points: Array = CIRCLE[:, :1] * across + CIRCLE[:, 1:] * upwards
        return points * item.size[0] + item.position
    if item.shape == "box":
        return corners_of(item)
    rim = np.insert(CIRCLE, 1, -0.5, axis=1)
    rims = np.concatenate([rim, rim * ((1, -1, 1) if item.shape == "cylinder" else (0, -1, 0))])
    return rims * item.size @ rotated_axes(item.rotation) + item.position


def convex_hull(places: Array) -> list[tuple[float, float]]:
    """Convex hull of (K, 2) points, by Andrew's monotone chain."""
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
