"""Pictures of machines as built, from one view or from all six."""

from __future__ import annotations

import base64
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.backdrop import SCREEN, Ground, backdrop
from agentflow.env.drawing.cameras import VIEWS, Camera, Size, View, camera_at, fit
from agentflow.env.drawing.plans import frame_of
from agentflow.env.drawing.raster import CORNERS, corners_of, draw
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.scene import Scene, SceneObject
from agentflow.errors import UnknownNameError
from agentflow.machine.tree import Machine

SHEET = "sheet"
"""Name of the picture that shows all views."""
COLUMNS = 3
"""Views per row of a sheet."""
SCALES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Possible lengths of the scale bar, m."""
AXES = {"x": (200, 40, 30), "y": (30, 130, 40), "z": (30, 70, 200)}
ARROW, CORNER = 34, 58
"""Length of the arrows of the axes, and how far from the left and lower edge they start, pixels."""
SMOOTH = 2
"""Supersampling: pictures are drawn this many times larger, then averaged."""
INK = (30, 32, 36)
GRID = 5.0
"""Distance between the lines on the ground of a level, m."""
ORTHOGRAPHIC = 1.0
"""Field of view of pictures to scale, degrees: so narrow that lengths do not depend on distance."""


@dataclass(frozen=True)
class StillOptions:
    """What else a picture shows, and on which ground."""

    ground: Ground | None = SCREEN
    """None: nothing is behind the machine."""
    axes: bool = False
    """Draw the directions x+, y+ and z+."""
    scale: bool = False
    """Draw a bar of round length, without perspective; all views of a sheet have one scale."""
    scene: Scene | None = None
    """A level; the machine is then where it starts there."""


PLAIN = StillOptions()


def render_png(
    machine: Machine,
    path: Path,
    *,
    view: str = "three-quarter",
    size: Size = (800, 600),
    red: Collection[int] = (),
    options: StillOptions = PLAIN,
) -> None:
    """Save a picture of a machine as built.

    Args:
        machine: A file-valid machine.
        path: PNG file to write.
        view: One of `cameras.VIEWS`, or `sheet` for all of them, each half as wide and high.
        size: Width and height in pixels.
        red: Blocks to draw in red.
        options: What else is shown.

    Raises:
        UnknownNameError: There is no such view.
    """
    _picture(machine, view, size, red, options).save(path, "PNG", optimize=True)


def png(machine: Machine, *, view: str, size: Size) -> bytes:
    """The picture of `render_png` as the content of a file."""
    return content_of(_picture(machine, view, size))


def level_png(given: Machine, scene: Scene, size: Size) -> bytes:
    """A small picture of a level with what is given there, in few colours."""
    drawn = _picture(given, "three-quarter", size, options=StillOptions(scene=scene))
    return content_of(drawn.quantize(64, dither=Image.Dither.NONE))


def png_url(machine: Machine, *, view: str, size: Size, red: Collection[int] = ()) -> str:
    """The picture of `render_png` as a data URL, for pages and requests."""
    return picture_url(_picture(machine, view, size, red))


def picture_url(picture: Image.Image) -> str:
    """Any picture as a data URL of a PNG."""
    return "data:image/png;base64," + base64.b64encode(content_of(picture)).decode()


def render_image(
    camera: Camera,
    solids: Sequence[SceneObject],
    others: Sequence[SceneObject],
    spacing: float,
    scenery: Sequence[SceneObject] = (),
    ground: Ground | None = SCREEN,
    origin: float = 0.0,
) -> Image.Image:
    """Draw solids (which cast shadows) and other objects on the ground.

    Args:
        camera: The view.
        solids: Of the machine.
        others: Other objects.
        spacing: Between the lines on the ground, m.
        scenery: Objects that are as glass where they would hide the rest.
        ground: Its colours; None for a transparent picture without shadows.
        origin: z from which the lines count, m.
    """
    large = replace(camera, width=SMOOTH * camera.width, height=SMOOTH * camera.height)
    if ground is None:
        nothing = Image.new("RGBA", (large.width, large.height), (0, 0, 0, 0))
        return draw(large, (*others, *solids), nothing, scenery).reduce(SMOOTH)
    behind = backdrop(large, solids, spacing, ground, origin)
    return draw(large, (*others, *solids), behind, scenery).reduce(SMOOTH).convert("RGB")


def caption(picture: Image.Image, text: str) -> None:
    """Write text into the upper left corner of a picture."""
    font = ImageFont.load_default(size=max(12, picture.height // 24))
    ImageDraw.Draw(picture).text((10, 8), text, fill=INK, font=font)


def content_of(picture: Image.Image) -> bytes:
    """A picture as the content of a PNG file."""
    content = BytesIO()
    picture.save(content, "PNG", optimize=True)
    return content.getvalue()


def _picture(
    machine: Machine,
    view: str,
    size: Size,
    red: Collection[int] = (),
    options: StillOptions = PLAIN,
) -> Image.Image:
    if view not in (*VIEWS, SHEET):
        raise UnknownNameError("view", view, (*VIEWS, SHEET))
    shapes, scene, ground = MachineSolids(machine), options.scene, options.ground
    if ground is not None and options.scale:
        ground = replace(ground, bare=True)
    pose = shapes.rest if scene is None else shapes.rest.at_start(scene.start)
    solids = shapes.objects(pose, red)
    points = np.concatenate([corners_of(solid) for solid in solids])
    if scene is not None:
        bounds = np.array(frame_of(scene.objects, points))
        points = CORNERS * np.ptp(bounds, axis=0) + bounds.mean(axis=0)
    names = tuple(VIEWS) if view == SHEET else (view,)
    if view == SHEET:
        size = (size[0] // 2, size[1] // 2)
    views = [View(VIEWS[name], size, ORTHOGRAPHIC if options.scale else 30.0) for name in names]
    fits = [fit(points, each) for each in views]
    same = max(distance for _, distance in fits) if options.scale else None
    tiles = []
    for name, each, (target, distance) in zip(names, views, fits, strict=True):
        camera = camera_at(target, same or distance, each)
        others = () if scene is None else scene.objects
        spacing = 1.0 if scene is None else GRID
        tile = render_image(camera, solids, (), spacing, others, ground)
        if options.axes:
            if options.ground:  # so that no label of a distance is behind their names
                side = (CORNER + 1.5 * ARROW) * _factor(tile)
                area = (0, tile.height - side, side, tile.height)
                ImageDraw.Draw(tile).ellipse(area, options.ground.land)
            draw_axes(tile, camera)
        if options.scale:
            draw_scale(tile, camera)
        if view == SHEET:
            caption(tile, name)
        tiles.append(tile)
    return tiled(tiles, COLUMNS)


def tiled(tiles: Sequence[Image.Image], columns: int, *, framed: bool = True) -> Image.Image:
    """Pictures of equal size as one, in rows; a single one stays as it is."""
    if len(tiles) == 1:
        return tiles[0]
    width, height = tiles[0].size
    rows = -(-len(tiles) // columns)
    whole = Image.new(tiles[0].mode, (columns * width, rows * height), "white")
    for index, tile in enumerate(tiles):
        if framed:
            ImageDraw.Draw(tile).rectangle((0, 0, width - 1, height - 1), outline=INK)
        whole.paste(tile, (index % columns * width, index // columns * height))
    return whole


def draw_axes(picture: Image.Image, camera: Camera) -> None:
    """Draw the directions x+, y+ and z+ in a corner; those towards the eye as points."""
    f = _factor(picture)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=13 * f)
    right, up, _ = camera.axes
    start = CORNER * f, picture.height - CORNER * f
    for name, axis in zip(AXES, np.eye(3), strict=True):
        across, rise = ARROW * f * float(right @ axis), -ARROW * f * float(up @ axis)
        x, y = start[0] + across, start[1] + rise
        pen.line((*start, x, y), fill=AXES[name], width=3 * f)
        if abs(across) + abs(rise) > ARROW * f / 4:
            where = (x + across * 0.35, y + rise * 0.35)
            pen.text(where, f"{name}+", AXES[name], font, "mm", stroke_width=2, stroke_fill="white")


def draw_scale(picture: Image.Image, camera: Camera) -> None:
    """Draw a bar of round length, at the distance of the machine."""
    f = _factor(picture)
    away = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    pixels = camera.focal_length / away
    metres = max((s for s in SCALES if s * pixels <= picture.width / 4), default=SCALES[0])
    right, y = picture.width - 20 * f, picture.height - 20 * f
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=13 * f)
    pen.line((right - metres * pixels, y, right, y), fill=INK, width=3 * f)
    where = (right - metres * pixels / 2, y - 12 * f)
    pen.text(where, f"{metres:g} m", INK, font, "mm", stroke_width=2, stroke_fill="white")


def _factor(picture: Image.Image) -> int:
    """How many times larger what is written is than in a picture 480 pixels high."""
    return max(1, round(picture.height / 480))
