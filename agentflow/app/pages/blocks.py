"""Pictures of block types with numbered faces and axes, and what each does in a few words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.app.machines.files import block_json
from agentflow.env.drawing.cameras import Camera, View, camera_at, fit, project
from agentflow.env.drawing.raster import corners_of, draw
from agentflow.env.drawing.solids import MachineSolids
from agentflow.env.drawing.stills import INK, SMOOTH, caption, picture_url, save_drawing
from agentflow.env.rollout import Array
from agentflow.env.scene import SceneObject
from agentflow.machine import ROOT, BlockType, Machine, Step, library, place
from agentflow.machine.geometry.pose import Placed
from agentflow.machine.geometry.vectors import add
from agentflow.prompts.render import block_functions, facts

TILE = (320, 300)
"""Width and height of one view, in pixels."""
VIEWS = {
    "front, right, above": (0.72, 0.5, 0.62),
    "back, left, below": (-0.72, -0.5, -0.62),
}
"""Directions to the eye, opposite to each other: every face is seen in one of them."""
AXES = {"x": (190, 40, 40), "y": (30, 120, 50), "z": (40, 70, 180)}
REACH = 0.35
"""How far the axes extend beyond the block, m."""
DOT = 9
"""Radius of the circle around a face's number, in pixels."""
ALOFT = (0.0, 10.0, 0.0)
"""Keeps blocks above the ground, which hides what is below it, m."""
PAPER = (255, 255, 255)
COLOURS = 48


def draw_block(block: BlockType, file: Path) -> Path:
    """Draw a block from two opposite sides, with the numbers of its faces and its axes.

    The axes begin at the building point; z is the direction that the block faces. The ends of
    two-ended blocks are labelled a and b.
    """
    machine, shown = _shown(block)
    placed, root = place(machine).blocks[-1], place(machine).blocks[0]
    lift = np.subtract(MachineSolids(machine).rest.centre[0], root.center) + ALOFT
    picture = Image.new("RGB", (len(VIEWS) * TILE[0], TILE[1]), PAPER)
    for column, name in enumerate(VIEWS):
        picture.paste(_tile(placed, shown, lift, name), (column * TILE[0], 0))
    return save_drawing(picture, file, COLOURS)


@lru_cache
def block_card(kind: int) -> Mapping[str, Any]:
    """A block for people who choose: `block_json`, what it does, the force (N) and moment (N m) at
    which it breaks off its parent, and a picture as a data URL."""
    strength = facts()["strength"]
    return {
        **block_json(library()[kind]),
        "does": block_functions()[kind],
        "strength": strength.get(kind, strength["usual"]),
        "picture": _small_url(library()[kind]),
    }


def _small_url(block: BlockType, size: int = 56) -> str:
    """A small square picture of a block on nothing, as a data URL."""
    _, shown = _shown(block)
    view = View(size=(SMOOTH * size, SMOOTH * size), fill=0.94)
    points = np.concatenate([corners_of(solid) for solid in shown])
    nothing = Image.new("RGBA", view.size, (*PAPER, 0))
    return picture_url(
        draw(camera_at(*fit(points, view, nearest=1.0), view), shown, nothing).reduce(SMOOTH)
    )


def draw_named(name: str, file: Path) -> Path:
    """Draw a block type given by id or name; see `draw_block`."""
    return draw_block(library().find(name), file)


def draw_all(folder: Path) -> list[Path]:
    """Draw every block of the library into a folder, named by type: 63.png."""
    return [draw_block(block, folder / f"{block.type}.png") for block in library().values()]


def _shown(block: BlockType) -> tuple[Machine, list[SceneObject]]:
    """The machine of `_example`, and the solids of its last block."""
    machine = _example(block)
    solids = MachineSolids(machine)
    return machine, [
        replace(solid, position=add(solid.position, ALOFT))
        for solid in solids.objects(solids.rest)
        if solid.name == f"block {len(machine) - 1}"
    ]


def _example(block: BlockType) -> Machine:
    """A machine whose last block is of this type, unrotated if it has one parent."""
    if block.type == ROOT.type:
        return Machine((ROOT,))
    if block.linear:  # from the back of the root to its front
        return Machine((ROOT, Step(1, block.type, 0, 1, 0, 0)))
    return Machine((ROOT, Step(1, block.type, 0, 0)))


def _tile(placed: Placed, solids: Sequence[SceneObject], lift: Array, name: str) -> Image.Image:
    """One view; `lift` moves the machine frame to the world, where the machine stands."""
    corners = np.concatenate([corners_of(solid) for solid in solids])
    origin = np.add(placed.origin, lift)
    tips = {
        axis: origin + np.eye(3)[i] * (max(corners[:, i].max() - origin[i], 0.0) + REACH)
        for i, axis in enumerate("" if placed.two_ended else "xyz")
    }
    points = np.concatenate([corners, np.reshape([*tips.values()], (-1, 3))])
    view = View(back=VIEWS[name], size=(SMOOTH * TILE[0], SMOOTH * TILE[1]), fill=0.78)
    camera = camera_at(*fit(points, view, nearest=1.0), view)
    paper = Image.new("RGBA", view.size, PAPER)
    tile = draw(camera, solids, paper).reduce(SMOOTH).convert("RGB")
    pen = ImageDraw.Draw(tile)
    _draw_axes(pen, camera, origin, tips)
    if placed.end_a is not None and placed.end_b is not None:
        marks = [("a", np.add(placed.end_a, lift)), ("b", np.add(placed.end_b, lift))]
    else:
        marks = _seen_faces(placed, camera, lift)
    for text, point in marks:
        x, y = _pixel(point, camera)
        pen.ellipse((x - DOT, y - DOT, x + DOT, y + DOT), fill=PAPER, outline=INK)
        pen.text((x, y), text, fill=INK, font=ImageFont.load_default(size=12), anchor="mm")
    caption(tile, name)
    return tile


def _seen_faces(placed: Placed, camera: Camera, lift: Array) -> list[tuple[str, Array]]:
    """Number and position of each face that is turned towards the eye."""
    found = []
    for face in placed.faces:
        point = np.add(face.position, lift)
        normal = np.eye(3)["xyz".index(face.facing[0])] * (1.0 if face.facing[1] == "+" else -1.0)
        if normal @ np.subtract(camera.eye, point) > 0:
            found.append((str(face.face_id), point))
    return found


def _draw_axes(
    pen: ImageDraw.ImageDraw, camera: Camera, origin: Array, tips: dict[str, Array]
) -> None:
    start = _pixel(origin, camera)
    for axis, tip in tips.items():
        end = _pixel(tip, camera)
        pen.line((*start, *end), fill=AXES[axis], width=2)
        font = ImageFont.load_default(size=15)
        pen.text(end, axis, AXES[axis], font, "mm", stroke_width=3, stroke_fill=PAPER)


def _pixel(point: Array, camera: Camera) -> tuple[float, float]:
    """Position in the finished tile, which is smaller than the camera's picture."""
    x, y = project(point[None], camera)[0] / SMOOTH
    return float(x), float(y)
