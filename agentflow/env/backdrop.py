"""Owns the ground of a picture: lines that show distance, shadows that show height.

They are painted flat wherever the renderer drew bare ground, which costs far less than solids and
looks better.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from agentflow.env.engines.base import Camera
from agentflow.env.rotations import rotate
from agentflow.env.scene import Thing
from agentflow.env.trace import Array
from agentflow.env.views import project

SUN = (-4.0, 12.0, -7.0)
"""Direction towards the light; near the one that shades the solids."""
LAND = (214, 219, 208)
LINE = (190, 197, 184)
INK = (118, 126, 114)
SHADE = 90
"""Darkness of a shadow, of 255."""
LINES = 25
"""Lines on either side of z = 0."""
SIDE_REACH, PIECES = 60.0, 49
"""How far a line goes in x, m, and of how many points it is made."""
LABEL_X = 3.5
"""Where along a line its label stands, m."""
SIGNS = np.array(list(product((-0.5, 0.5), repeat=3)))
QUADS = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
"""Corner indices of a box's six sides."""
HUE_TOLERANCE = 0.03


def backdrop(camera: Camera, solids: Sequence[Thing], spacing: float) -> Image.Image:
    """The ground as the camera sees it, with lines every `spacing` metres along z."""
    size = (camera.width, camera.height)
    picture = Image.new("RGB", size, LAND)
    pen = ImageDraw.Draw(picture)
    _lines(pen, camera, spacing)
    shade = Image.new("L", size, 0)
    shadow = ImageDraw.Draw(shade)
    for outline in _shadows(camera, solids):
        shadow.polygon(outline, fill=SHADE)
    shade = shade.filter(ImageFilter.GaussianBlur(camera.height / 400))
    picture.paste((30, 36, 30), (0, 0, *size), shade)
    return picture


def bare_ground(pixels: NDArray[np.uint8], ground: NDArray[np.uint8]) -> Image.Image:
    """Mask of the pixels that have the hue of the ground, lit or in shadow, or are sky."""
    colour = pixels.astype(np.float32)
    total = colour.sum(axis=2)
    wanted = ground.astype(np.float32) / max(1.0, float(ground.sum()))
    off = np.abs(colour - total[:, :, None] * wanted)
    near = np.maximum(np.maximum(off[:, :, 0], off[:, :, 1]), off[:, :, 2]) < HUE_TOLERANCE * total
    sky = total == 3 * 255
    return Image.fromarray(((near | sky) * 255).astype(np.uint8), "L")


def _lines(pen: ImageDraw.ImageDraw, camera: Camera, spacing: float) -> None:
    font = ImageFont.load_default(size=max(10, camera.height // 32))
    width = max(1, camera.height // 300)
    zs = spacing * np.arange(-LINES, LINES + 1)
    xs = np.linspace(-SIDE_REACH, SIDE_REACH, PIECES)
    points = np.stack([np.tile(xs, len(zs)), np.zeros(len(zs) * PIECES), np.repeat(zs, PIECES)], 1)
    for line in project(points, camera).reshape(len(zs), PIECES, 2):
        seen = line[_near(line, camera)]
        if len(seen) > 1:
            pen.line(seen.ravel().tolist(), fill=LINE, width=width)
    if spacing > 1.0:
        labels = np.stack([np.full(len(zs), LABEL_X), np.zeros(len(zs)), zs], axis=1)
        places = project(labels, camera)
        for z, place in zip(zs[_near(places, camera)], places[_near(places, camera)], strict=True):
            pen.text(place.tolist(), f"{z:g} m", fill=INK, font=font, anchor="lb")


def _near(places: Array, camera: Camera) -> NDArray[np.bool_]:
    """Which pixels (..., 2) are before the camera and not absurdly far outside the picture."""
    with np.errstate(invalid="ignore"):
        near: NDArray[np.bool_] = np.abs(places).max(axis=-1) < 8 * camera.width
    return near


def _shadows(camera: Camera, solids: Sequence[Thing]) -> Iterator[list[tuple[float, float]]]:
    """Polygons in the picture that together cover the solids' shadows."""
    sun = np.asarray(SUN)
    for thing in solids:
        corners = rotate(np.tile(thing.rotation, (8, 1)), SIGNS * _extents(thing)) + thing.position
        fallen = corners - sun * (corners[:, 1:2] / sun[1])
        places = project(fallen, camera)
        if not _near(places, camera).all():
            continue
        for quad in QUADS:
            yield [(float(places[i, 0]), float(places[i, 1])) for i in quad]


def _extents(thing: Thing) -> Array:
    """Full extents of the box that casts a thing's shadow."""
    size = np.asarray(thing.size)
    return 0.8 * np.repeat(size[0], 3) if thing.shape == "sphere" else size
