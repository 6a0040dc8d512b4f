"""Pictures for agents: a machine at rest or in its rollout, with axes, scale and block ids."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.cameras import (
    THREE_QUARTER,
    VIEWS,
    Camera,
    Size,
    View,
    camera_at,
    fit,
    project,
)
from agentflow.env.drawing.film import objects_at
from agentflow.env.drawing.raster import corners_of
from agentflow.env.drawing.solids import MachineSolids, Pose
from agentflow.env.drawing.stills import INK, caption, render_image
from agentflow.env.rollout import Array, Rollout
from agentflow.env.scene import SceneObject
from agentflow.errors import UsageError
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine

SIZE: Size = (640, 480)
DIRECTIONS: dict[str, Vec3] = {
    "front": VIEWS["front"],
    "side": VIEWS["right"],
    "top": VIEWS["top"],
    "iso": THREE_QUARTER,
}
"""View -> direction from the machine to the eye; the top view has z+ at its upper edge."""
FIELD_OF_VIEW = 12.0
"""Vertical, degrees: narrow, so that lengths hardly depend on how far away they are."""
NEAR = 12.0
"""Blocks farther than this from the root are left out of the frame, m."""
SCALES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Possible lengths of the scale bar, m."""
AXES = {"x": (200, 40, 30), "y": (30, 130, 40), "z": (30, 70, 200)}
ARROW, CORNER = 34, (52, 428)
"""Length of the arrows of the axes, and where they start, in pixels."""


def look_at(
    machine: Machine, view: str, rollout: Rollout | None = None, time: float | None = None
) -> bytes:
    """Draw a machine as built, or at a time of its rollout, as a PNG picture of 640 x 480.

    Args:
        machine: A file-valid machine.
        view: One of `DIRECTIONS`.
        rollout: Its rollout, if there is a time.
        time: Seconds since t = 0; the nearest sample is drawn. None: as built, without the scene.

    Raises:
        UsageError: The rollout has no states, or not at that time.
    """
    shapes = MachineSolids(machine)
    pose, objects, broken, said = shapes.rest, list[SceneObject](), set[int](), "as built"
    if rollout is not None and time is not None:
        pose, objects, broken, said = _at(rollout, time)
    solids = shapes.objects(pose, broken)
    near = np.linalg.norm(pose.centre - pose.centre[0], axis=1) <= NEAR
    framed = [item for item in solids if near[int(item.name.removeprefix("block "))]]
    seen = View(DIRECTIONS[view], SIZE, FIELD_OF_VIEW)
    points = np.concatenate([corners_of(item) for item in framed])
    camera = camera_at(*fit(points, seen), seen)
    picture = render_image(camera, solids, objects, spacing=1.0)
    _label_blocks(picture, camera, pose.centre)
    _draw_axes(picture, camera)
    _draw_scale(picture, camera)
    caption(picture, f"{view}, {said}")
    content = BytesIO()
    picture.save(content, "PNG", optimize=True)
    return content.getvalue()


def _at(rollout: Rollout, time: float) -> tuple[Pose, list[SceneObject], set[int], str]:
    """Pose, moved scene, broken blocks and caption at the sample nearest to a time."""
    trace = rollout.trace
    if trace is None:
        raise UsageError(
            f"nothing was recorded, because the simulation ended with status {rollout.status}; "
            "look without a time"
        )
    last = float(trace.times[-1])
    if not 0.0 <= time <= last:
        raise UsageError(
            f"there is no picture at {time:g} s; the simulation goes from 0 to {last:g} s"
        )
    index = int(np.abs(trace.times - time).argmin())
    at = float(trace.times[index])
    objects = objects_at(rollout.scene, trace, index) if rollout.scene else []
    broken = {item.block for item in rollout.broken if item.time <= at}
    return Pose.at(trace, index), objects, broken, f"{at:.2f} s"


def _label_blocks(picture: Image.Image, camera: Camera, centres: Array) -> None:
    """Write the ids of blocks at their centres; where they would overlap, the lowest id stays."""
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=12)
    taken: list[Sequence[float]] = []
    for block, (x, y) in enumerate(project(centres, camera).tolist()):
        if not (0 <= x < picture.width and 0 <= y < picture.height):
            continue
        box = pen.textbbox((x, y), str(block), font=font, anchor="mm")
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken):
            continue
        taken.append(box)
        pen.text((x, y), str(block), INK, font, "mm", stroke_width=2, stroke_fill="white")


def _draw_axes(picture: Image.Image, camera: Camera) -> None:
    """Draw the directions x+, y+ and z+ in a corner; those towards the eye as points."""
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=13)
    right, up, _ = camera.axes
    for name, axis in zip(AXES, np.eye(3), strict=True):
        across, rise = ARROW * float(right @ axis), -ARROW * float(up @ axis)
        x, y = CORNER[0] + across, CORNER[1] + rise
        pen.line((*CORNER, x, y), fill=AXES[name], width=3)
        if abs(across) + abs(rise) > ARROW / 4:
            where = (x + across * 0.35, y + rise * 0.35)
            pen.text(where, f"{name}+", AXES[name], font, "mm", stroke_width=2, stroke_fill="white")


def _draw_scale(picture: Image.Image, camera: Camera) -> None:
    """Draw a bar of round length, at the distance of the machine."""
    away = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    pixels = camera.focal_length / away
    metres = max((s for s in SCALES if s * pixels <= picture.width / 4), default=SCALES[0])
    right, y = picture.width - 20, picture.height - 20
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=13)
    pen.line((right - metres * pixels, y, right, y), fill=INK, width=3)
    where = (right - metres * pixels / 2, y - 12)
    pen.text(where, f"{metres:g} m", INK, font, "mm", stroke_width=2, stroke_fill="white")
