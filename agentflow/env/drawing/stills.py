"""Pictures of machines as built, from one view or from all six."""

import base64
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.backdrop import (
    CLEAR,
    SCREEN,
    Course,
    Ground,
    backdrop,
    mark_distances,
    shadow_of,
)
from agentflow.env.drawing.cameras import VIEWS, Camera, Size, View, camera_at, fit, lit
from agentflow.env.drawing.plans import frame_of
from agentflow.env.drawing.raster import CORNERS, corners_of, draw
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.scene import Scene, SceneObject
from agentflow.errors import UnknownNameError, UsageError
from agentflow.files.atomic import write_output
from agentflow.machine.tree import Machine

SHEET = "sheet"
"""Name of the picture that shows all views."""
COLUMNS = 3
"""Views per row of a sheet."""
SCALES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Possible lengths of the scale bar, m."""
AXES = {"x": (200, 40, 30), "y": (30, 130, 40), "z": (30, 70, 200)}
ARROW, CORNER = 34, (62, 40)
"""Length of the arrows of the axes, and how far from the left and lower edge they start, pixels."""
AXES_BAND, SCALE_BAND, MOST = 96, 44, 0.3
"""Height of what the axes and the scale bar need at the lower edge of a picture, pixels, and the
most of its height that they get."""
FILL = 0.88
"""Share of a picture's width or height that the machine may fill."""
SMOOTH = 2
"""Supersampling: pictures are drawn this many times larger, then averaged."""
INK, FRAME = (30, 32, 36), (178, 182, 176)
LETTERS = 24
"""Letters of a caption in the height of a picture."""
FAR = 3.0
"""How far the grid of a level is clear, as `backdrop.CLEAR`."""
ORTHOGRAPHIC = 1.0
"""Field of view of sides and drawings to scale, degrees: lengths do not depend on distance."""
SHEET_FILL, FOOT = 0.92, 40
"""Share of a panel of a sheet that a machine may fill, and height of the line below all panels with
the machine's measures and the scale, pixels."""


@dataclass(frozen=True)
class StillOptions:
    """What else a picture shows, such as the directions x+, y+ and z+, and on which ground."""

    ground: Ground | None = SCREEN
    """None: nothing is behind the machine."""
    axes: bool = False
    scale: bool = False
    """Draw a bar of round length, without perspective."""
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
        view: One of `cameras.VIEWS`, or `sheet` for all of them in two rows.
        size: Width and height of the whole picture in pixels.
        red: Blocks to draw in red.
        options: What else is shown.

    Raises:
        UnknownNameError: There is no such view.
    """
    _picture(machine, view, size, red, options).save(path, "PNG", optimize=True)


def png(machine: Machine, *, view: str, size: Size) -> bytes:
    """The picture of `render_png` as the content of a file."""
    return content_of(_picture(machine, view, size))


def level_png(machine: Machine, scene: Scene, size: Size) -> bytes:
    """A picture of a level with a machine at its start, in few colours."""
    drawn = _picture(machine, "three-quarter", size, options=StillOptions(scene=scene))
    return content_of(in_few_colours(drawn))


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
    scenery: Sequence[SceneObject] = (),
    ground: Ground | None = SCREEN,
    clear: float = CLEAR,
    course: Course | None = None,
    mark: Callable[[Image.Image, Camera], None] | None = None,
) -> Image.Image:
    """Draw solids (which cast shadows) and other objects on the ground.

    Args:
        camera: The view.
        solids: Of the machine.
        others: Other objects.
        scenery: Objects that are as glass where they would hide the rest.
        ground: Its colours; None for a transparent picture without shadows.
        clear: How far its grid is clear, as `backdrop.CLEAR`.
        course: Marks of distances; None: there are none.
        mark: Draws on the picture while it is large, before distances are written on what is free.
    """
    large = replace(camera, width=SMOOTH * camera.width, height=SMOOTH * camera.height)
    if ground is None:
        nothing = Image.new("RGBA", (large.width, large.height), (0, 0, 0, 0))
        return draw(large, (*others, *solids), nothing, scenery).reduce(SMOOTH)
    behind = backdrop(large, solids, ground, clear, course)
    picture = draw(large, (*others, *solids), behind, scenery)
    if mark is not None:
        mark(picture, large)
    if course is not None:
        mark_distances(picture, behind, large, course, ground)
    return picture.reduce(SMOOTH).convert("RGB")


def caption(picture: Image.Image, text: str, letters: int = LETTERS) -> None:
    """Write text into the upper left corner of a picture, as many letters high as given."""
    pen, size = ImageDraw.Draw(picture), letter_size(picture, text, letters)
    font, rim = ImageFont.load_default(size=size), max(2, size // 14)
    pen.text((size / 2, size / 2), text, INK, font, stroke_width=rim, stroke_fill="white")


def letter_size(picture: Image.Image, text: str, letters: int) -> int:
    """Size at which so many letters are as high as a picture, or smaller, so that a text fits in,
    pixels."""
    size = max(12, picture.height // letters)
    wide = ImageFont.load_default(size=size).getlength(text) + 2 * size
    return max(1, min(size, int(size * picture.width / wide)))


def in_few_colours(picture: Image.Image, colours: int = 64) -> Image.Image:
    """The picture in few colours, without dithering, for a small file."""
    return picture.quantize(colours, dither=Image.Dither.NONE)


def save_drawing(picture: Image.Image, file: Path, colours: int = 64) -> Path:
    """Save a drawing in few colours; UsageError if the file is no PNG."""
    if file.suffix.lower() != ".png":
        raise UsageError(f"the picture must be a .png file, not {file.name!r}")
    with write_output(file) as part:
        file.parent.mkdir(parents=True, exist_ok=True)
        in_few_colours(picture, colours).save(part, "PNG", optimize=True)
    return file


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
    shapes, scene = MachineSolids(machine), options.scene
    pose = shapes.rest if scene is None else shapes.rest.at_start(scene.start)
    solids = shapes.objects(pose, red)
    points = np.concatenate([corners_of(solid) for solid in solids])
    measures, sheet = np.ptp(points, axis=0), view == SHEET
    angle = 30.0 if view == "three-quarter" and not options.scale else ORTHOGRAPHIC
    if scene is not None and scene.objects:
        bounds = np.array(frame_of(scene.objects, points))
        points = CORNERS * np.ptp(bounds, axis=0) + bounds.mean(axis=0)
    elif angle != ORTHOGRAPHIC and options.ground is not None:
        points = np.concatenate([points, *(shadow_of(solid) for solid in solids)])
    names, cell, foot, fill = [view], size, 0, FILL
    band = AXES_BAND if options.axes else SCALE_BAND * options.scale
    if sheet:
        foot = min(round(FOOT * _factor((size[0] // COLUMNS, size[1] // 2))), size[1] // 4)
        cell = (-(-size[0] // COLUMNS), -(-(size[1] - foot) // 2))
        names, band, fill = list(VIEWS), 0, SHEET_FILL
    below = min(MOST, band * _factor(cell) / cell[1])
    views = [View(VIEWS[name], cell, angle, fill, below) for name in names]
    fits = [fit(points, each) for each in views]
    away, tiles = max(distance for _, distance in fits), []
    for name, each, (target, _) in zip(names, views, fits, strict=True):
        camera = lit(camera_at(target, away, each))
        others = () if scene is None else scene.objects
        clear = CLEAR if scene is None else FAR
        tile = render_image(camera, solids, (), others, options.ground, clear)
        if options.axes or sheet:
            draw_axes(tile, camera, sheet)
        if sheet:
            caption(tile, name)
        tiles.append(tile)
    whole = tiles[0]
    if sheet:
        whole = Image.new(whole.mode, size, whole.getpixel((0, 0)))
        whole.paste(tiled(tiles, COLUMNS, (size[0], size[1] - foot)), (0, 0))
        width, height, length = (f"{metres:.3g} m" for metres in measures)
        words = f"length (z) {length}, width (x) {width}, height (y) {height}"
        font = ImageFont.load_default(size=letter_size(whole, words, 60))
        at = (foot / 3, size[1] - foot / 2)
        ImageDraw.Draw(whole).text(at, words, INK, font, "lm")
    if options.scale:
        draw_scale(whole, camera, cell)
    return whole


def tiled(tiles: Sequence[Image.Image], columns: int, size: Size | None = None) -> Image.Image:
    """Pictures of equal size as one of a size, by default that of all; a single one stays as it
    is."""
    if len(tiles) == 1:
        return tiles[0]
    rows = -(-len(tiles) // columns)
    width, height = size or (columns * tiles[0].width, rows * tiles[0].height)
    whole = Image.new(tiles[0].mode, (width, height), "white")
    for index, tile in enumerate(tiles):
        ImageDraw.Draw(tile).rectangle((0, 0, tile.width - 1, tile.height - 1), outline=FRAME)
        row, column = divmod(index, columns)
        whole.paste(tile, (column * width // columns, row * height // rows))
    return whole


def draw_axes(picture: Image.Image, camera: Camera, anywhere: bool = False) -> None:
    """Draw the directions x+, y+ and z+ in a corner, the emptiest if `anywhere`; those towards the
    eye as points."""
    f = _factor(picture.size)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=13 * f)
    right, up, _ = camera.axes
    side, low = CORNER[0] * f, picture.height - CORNER[1] * f
    start = side, low
    if anywhere:
        far, low = picture.width - side, picture.height - side
        places = (far, side), (far, low), (side, low)
        start = min(places, key=lambda at: _filled(picture, at, side))
    for name, axis in zip(AXES, np.eye(3), strict=True):
        across, rise = ARROW * f * float(right @ axis), -ARROW * f * float(up @ axis)
        x, y = start[0] + across, start[1] + rise
        pen.line((*start, x, y), fill=AXES[name], width=round(3 * f))
        if abs(across) + abs(rise) > ARROW * f / 4:
            where = (x + across * 0.35, y + rise * 0.35)
            pen.text(where, f"{name}+", AXES[name], font, "mm", stroke_width=2, stroke_fill="white")


def draw_scale(picture: Image.Image, camera: Camera, panel: Size | None = None) -> None:
    """Draw a bar of round length, at the distance of the machine, as it is in a panel."""
    f = _factor(panel or picture.size)
    away = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    pixels = camera.focal_length / away
    metres = max((s for s in SCALES if s * pixels <= picture.width / 2.5), default=SCALES[0])
    right, y = picture.width - 20 * f, picture.height - 20 * f
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=15 * f)
    pen.line((right - metres * pixels, y, right, y), fill=INK, width=round(3 * f))
    where = (right - metres * pixels / 2, y - 12 * f)
    pen.text(where, f"{metres:g} m", INK, font, "mm", stroke_width=2, stroke_fill="white")


def _filled(picture: Image.Image, at: tuple[float, float], reach: float) -> int:
    """How much is in a square of a picture; a few thin lines count as nothing."""
    x, y = at
    square = picture.crop((int(x - reach), int(y - reach), int(x + reach), int(y + reach)))
    return round(float(np.asarray(square.convert("L")).std()) / 20)


def _factor(size: Size) -> float:
    """How many times larger what is written is than in a picture of 480 pixels."""
    return max(1.0, min(size) / 480)
