"""The ground of a picture: its grid, distances along it, and shadows of the solids."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from agentflow.env.drawing.cameras import Camera, axes_of, project
from agentflow.env.drawing.raster import NARROW, corners_of
from agentflow.env.rollout import Array
from agentflow.env.rotations import rotated_axes
from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.balance import convex_hull
from agentflow.machine.geometry.vectors import Vec3


@dataclass(frozen=True)
class Ground:
    """Colours of what is behind a machine: land, lines of the grid, ink of distances; and the
    opacity of a shadow, of 255."""

    land: tuple[int, int, int]
    line: tuple[int, int, int]
    ink: tuple[int, int, int]
    shade: int


@dataclass(frozen=True)
class Course:
    """The marks of distances along z+, with 0 at z = `zero`, and the ends of the line along which a
    score was measured; m. A picture is as many letters of the marks high as given."""

    zero: float = 0.0
    measured: tuple[Vec3, Vec3] | None = None
    letters: int = 30


SCREEN = Ground((214, 219, 208), (186, 193, 180), (84, 92, 80), 72)
PAPER = Ground((255, 255, 255), (214, 214, 214), (84, 84, 84), 56)
DARK = (30, 36, 30)
FALL = (-2.5, 12.0, -4.5)
"""Direction from shadows to their light: steeper than the light on surfaces, so that they are no
longer than what casts them."""
GRIDS = ((1.0, 0.4), (5.0, 1.0), (50.0, 1.0))
"""Distance between the lines of each grid on the ground (m), and their strength."""
TONES = (16, 2)
"""Tones of the lines besides that of the ground, without and with a course: there few, so that
films stay small."""
CLEAR = 1.3
"""Up to where the grid is clear, in half heights of what the camera sees at its target; at twice
this, it has faded out."""
STEPS, FARTHEST = (5.0, 10.0, 20.0, 50.0, 100.0), 500.0
"""Possible distances between marks, and that of the last one, m."""
TINT = 48
"""By how much glass may differ from what is behind it, of 255."""
LABEL_X = 4.0
"""x of the labels, m, unless they would be less than a letter below x = 0."""
LEVEL, STEEP = 0.02, 0.999
"""Sines of how far a camera looks down below which it sees the ground from its side, and above
which from above: it then shows neither grid nor shadows, which tell nothing from there."""
_TURNS = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1) / 2
"""(24, 2) points of a circle of diameter 1."""


def backdrop(
    camera: Camera,
    solids: Sequence[SceneObject],
    ground: Ground = SCREEN,
    clear: float = CLEAR,
    course: Course | None = None,
) -> Image.Image:
    """Draw the ground (RGBA) with its grid, which is wider where there is a course, shadows, and
    the line along which a score was measured.

    Args:
        camera: The view; its width and height are even.
        solids: What casts shadows.
        ground: Colours.
        clear: As `CLEAR`.
        course: The marks, with whose 0 the grid begins.
    """
    size = (camera.width, camera.height)
    picture = Image.new("RGBA", size, ground.land)
    down = float(camera.axes[2][1])
    if down < LEVEL:
        pen, height = ImageDraw.Draw(picture), max(2, camera.height // 300)
        ((_, y),) = project(np.array([(camera.target[0], 0.0, camera.target[2])]), camera)
        pen.rectangle((0, y, camera.width, y + height), ground.line)
    if not LEVEL <= down <= STEEP:
        return picture
    zero = 0.0 if course is None else course.zero
    lines = _grid(camera, clear, GRIDS[course is not None :], zero)
    tones = TONES[course is not None]
    ink = Image.fromarray((255 / tones * np.round(tones * lines)).astype(np.uint8))
    picture.paste(ground.line, (0, 0), ink.resize(size, Image.Resampling.NEAREST))
    shade = Image.new("L", size, 0)
    pen = ImageDraw.Draw(shade)
    if camera.focal_length < NARROW * camera.height:  # in drawings to scale, they say nothing
        for outline in _shadows(camera, solids):
            pen.polygon(outline, fill=ground.shade)
    if (area := shade.getbbox()) is not None:
        soft = max(1, camera.height // 250)
        grown = np.add(area, (-3 * soft, -3 * soft, 3 * soft, 3 * soft)).tolist()
        soften = ImageFilter.GaussianBlur(soft)
        picture.paste(DARK, grown, shade.crop(grown).filter(soften))
    if course is not None and course.measured is not None:
        _measure(picture, camera, course.measured, ground)
    return picture


def _grid(camera: Camera, clear: float, grids: Sequence[tuple[float, float]], zero: float) -> Array:
    """(H / 2, W / 2) strength of the grid, from 0 to 1, in every second pixel.

    Lines are about two pixels wide; where they would be too close, they fade.
    """
    right, up, towards = camera.axes
    u = ((np.arange(1, camera.width, 2) - camera.width / 2) / camera.focal_length)[None]
    v = ((camera.height / 2 - np.arange(1, camera.height, 2)) / camera.focal_length)[:, None]
    fall = towards[1] - v * up[1]
    with np.errstate(divide="ignore"):
        ahead = np.where(fall > 1e-3, camera.eye[1] / fall, np.nan)  # to the ground
    away = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    half = away * camera.height / (2 * camera.focal_length)
    wide = max(2.0, camera.height / 700)
    ink: Array = np.zeros((v.size, u.size), dtype=np.float32)
    squares: Array = np.zeros_like(ink)
    for axis, start in ((0, 0.0), (2, zero)):
        place = (
            camera.eye[axis] + ahead * (v * up[axis] - towards[axis] + u * right[axis])
        ).astype(np.float32)
        squares += (place - camera.target[axis]) ** 2
        pixel = np.abs(np.gradient(place, axis=0)) + np.abs(np.gradient(place, axis=1))
        for every, strength in grids:
            off = np.abs((place - start + every / 2) % every - every / 2)
            thin = np.clip(1.25 - 6 * pixel / every, 0, 1)
            line = strength * np.clip(wide / 2 - off / pixel, 0, 1) * thin
            np.fmax(ink, line, out=ink)
    faded: Array = ink * np.clip(2 - np.sqrt(squares) / (clear * half), 0, 1)
    return np.nan_to_num(faded)


def _measure(picture: Image.Image, camera: Camera, ends: tuple[Vec3, Vec3], ground: Ground) -> None:
    """Draw the line along which a score was measured, with a tick at each end."""
    pen, width = ImageDraw.Draw(picture), max(2, camera.height // 200)
    (x, _, start), (_, _, end) = ends
    for a, b in (
        ((x, start), (x, end)),
        ((x - 1, start), (x + 1, start)),
        ((x - 1, end), (x + 1, end)),
    ):
        line = np.linspace((a[0], 0.0, a[1]), (b[0], 0.0, b[1]), 64)
        seen = [
            tuple(place) for place in project(line, camera).tolist() if np.isfinite(place).all()
        ]
        pen.line(seen, fill=ground.ink, width=width)


def mark_distances(
    picture: Image.Image, behind: Image.Image, camera: Camera, course: Course, ground: Ground
) -> None:
    """Write distances in the smallest equal steps at which none is over another, where the backdrop
    `behind` is still seen; none is cut."""
    size = max(20, camera.height // course.letters)
    font = ImageFont.load_default(size=size)
    pen = ImageDraw.Draw(picture)
    for step in STEPS:
        ways: Array = np.arange(0.0, FARTHEST + step, step)
        line = np.outer(ways, (0.0, 0.0, 1.0)) + np.array((0.0, 0.0, course.zero))
        places = project(line + np.array((LABEL_X, 0.0, 0.0)), camera)
        places[:, 1] = np.maximum(places[:, 1], project(line, camera)[:, 1] + size)
        labels = [
            (f"{way:g} m", *pen.textbbox(place, f"{way:g} m", font=font, anchor="lt"))
            for way, place in zip(ways.tolist(), places.tolist(), strict=True)
            if 0 <= place[0] <= camera.width and 0 <= place[1] <= camera.height
        ]
        if all(_are_apart(one[1:], other[1:]) for one, other in pairwise(labels)):
            break
    for words, left, top, right, bottom in labels:
        box = (int(left), int(top), int(right) + 1, int(bottom) + 1)
        there, bare = (np.asarray(item.crop(box), dtype=int) for item in (picture, behind))
        inside = right < camera.width and bottom < camera.height
        if inside and np.abs(there - bare).max() < TINT:
            place = left, top
            pen.text(place, words, ground.ink, font, "lt", stroke_width=3, stroke_fill=ground.land)


def _are_apart(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Whether there is room between two boxes of letters."""
    gap = one[3] - one[1]
    aside = one[2] + gap < other[0] or other[2] + gap < one[0]
    return aside or one[3] < other[1] or other[3] < one[1]


def _shadows(camera: Camera, solids: Sequence[SceneObject]) -> Iterator[list[tuple[float, float]]]:
    """Outline of each solid's shadow in the picture; all solids are convex."""
    for item in solids:
        places = project(shadow_of(item), camera)
        with np.errstate(invalid="ignore"):
            if np.abs(places).max() < 8 * camera.width:
                yield convex_hull(map(tuple, places.tolist()))


def shadow_of(item: SceneObject) -> Array:
    """(K, 3) points on the ground that span the shadow of a solid."""
    points = silhouette(item)
    shadow: Array = points - np.asarray(FALL) * (points[:, 1:2] / FALL[1])
    return shadow


def silhouette(item: SceneObject) -> Array:
    """(K, 3) points of a solid whose projections span its shadow."""
    if item.shape == "sphere":
        across, upwards, _ = axes_of(np.asarray(FALL))
        points: Array = CIRCLE[:, :1] * across + CIRCLE[:, 1:] * upwards
        return points * item.size[0] + item.position
    if item.shape == "box":
        return corners_of(item)
    rim = np.insert(CIRCLE, 1, -0.5, axis=1)
    rims = np.concatenate([rim, rim * ((1, -1, 1) if item.shape == "cylinder" else (0, -1, 0))])
    return rims * item.size @ rotated_axes(item.rotation) + item.position
