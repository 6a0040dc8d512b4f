"""Pictures of machines as built, from one view or from all six."""

from __future__ import annotations

import base64
from collections.abc import Collection, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.backdrop import backdrop
from agentflow.env.drawing.cameras import VIEWS, Camera, Size, View, camera_at, fit
from agentflow.env.drawing.raster import corners_of, draw
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.scene import SceneObject
from agentflow.errors import UnknownNameError
from agentflow.machine.tree import Machine

SHEET = "sheet"
"""Name of the picture that shows all views."""
COLUMNS = 3
"""Views per row of a sheet."""
SMOOTH = 2
"""Supersampling: pictures are drawn this many times larger, then averaged."""
INK = (30, 32, 36)


def render_png(
    machine: Machine,
    path: Path,
    *,
    view: str = "three-quarter",
    size: Size = (800, 600),
    red: Collection[int] = (),
) -> None:
    """Save a picture of a machine as built.

    Args:
        machine: A file-valid machine.
        path: PNG file to write.
        view: One of `cameras.VIEWS`, or `sheet` for all of them, each half as wide and high.
        size: Width and height in pixels.
        red: Blocks to draw in red.

    Raises:
        UnknownNameError: There is no such view.
    """
    _picture(machine, view, size, red).save(path, "PNG", optimize=True)


def png(machine: Machine, *, view: str, size: Size) -> bytes:
    """The picture of `render_png` as the content of a file."""
    return _content(_picture(machine, view, size))


def png_url(machine: Machine, *, view: str, size: Size, red: Collection[int] = ()) -> str:
    """The picture of `render_png` as a data URL, for pages and requests."""
    return picture_url(_picture(machine, view, size, red))


def picture_url(picture: Image.Image) -> str:
    """Any picture as a data URL of a PNG."""
    return "data:image/png;base64," + base64.b64encode(_content(picture)).decode()


def render_image(
    camera: Camera,
    solids: Sequence[SceneObject],
    others: Sequence[SceneObject],
    spacing: float,
    scenery: Sequence[SceneObject] = (),
) -> Image.Image:
    """Draw solids (which cast shadows) and other objects on the ground.

    Args:
        camera: The view.
        solids: Of the machine.
        others: Other objects.
        spacing: Between the lines on the ground, m.
        scenery: Objects that are as glass where they would hide the rest.
    """
    large = replace(camera, width=SMOOTH * camera.width, height=SMOOTH * camera.height)
    ground = backdrop(large, solids, spacing)
    return draw(large, (*others, *solids), ground, scenery).reduce(SMOOTH).convert("RGB")


def caption(picture: Image.Image, text: str) -> None:
    """Write text into the upper left corner of a picture."""
    font = ImageFont.load_default(size=max(12, picture.height // 24))
    ImageDraw.Draw(picture).text((10, 8), text, fill=INK, font=font)


def _content(picture: Image.Image) -> bytes:
    content = BytesIO()
    picture.save(content, "PNG", optimize=True)
    return content.getvalue()


def _picture(machine: Machine, view: str, size: Size, red: Collection[int] = ()) -> Image.Image:
    if view not in (*VIEWS, SHEET):
        raise UnknownNameError("view", view, (*VIEWS, SHEET))
    shapes = MachineSolids(machine)
    solids = shapes.objects(shapes.rest, red)
    if view == SHEET:
        return _sheet(solids, (size[0] // 2, size[1] // 2))
    return _still(solids, view, size)


def _still(solids: Sequence[SceneObject], name: str, size: Size) -> Image.Image:
    view = View(back=VIEWS[name], size=size)
    target, distance = fit(np.concatenate([corners_of(solid) for solid in solids]), view)
    return render_image(camera_at(target, distance, view), solids, (), spacing=1.0)


def _sheet(solids: Sequence[SceneObject], size: Size) -> Image.Image:
    """All views in rows, each labelled with its name."""
    rows = -(-len(VIEWS) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * size[0], rows * size[1]))
    for index, name in enumerate(VIEWS):
        tile = _still(solids, name, size)
        caption(tile, name)
        ImageDraw.Draw(tile).rectangle((0, 0, size[0] - 1, size[1] - 1), outline=INK)
        sheet.paste(tile, (index % COLUMNS * size[0], index // COLUMNS * size[1]))
    return sheet
