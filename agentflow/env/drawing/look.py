"""Pictures for agents: a machine at rest or in its rollout, with axes, scale and block ids."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import dist

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
from agentflow.env.drawing.raster import CORNERS, corners_of
from agentflow.env.drawing.solids import MachineSolids, Pose
from agentflow.env.drawing.stills import (
    INK,
    caption,
    content_of,
    draw_axes,
    draw_scale,
    render_image,
    tiled,
)
from agentflow.env.feedback.separation import held_pairs, joined_to
from agentflow.env.rollout import Array, Rollout
from agentflow.env.scene import Body, SceneObject
from agentflow.errors import UsageError
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine

SIZE: Size = (640, 480)
PANEL, COLUMNS = (480, 360), 2
"""Size of each picture of several moments, and how many are in a row."""
MOST_MOMENTS = 4
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
"""Blocks farther than this from what the camera follows are left out of the frame, m."""
AROUND = 4.0
"""Side of the cube around the centre of what it follows that is in the frame at least, m."""


@dataclass(frozen=True)
class _Moment:
    """What a picture shows."""

    said: str
    pose: Pose
    broken: Collection[int] = ()
    moving: Sequence[SceneObject] = ()
    fixed: Sequence[SceneObject] = ()
    connected: Collection[tuple[int, int]] | None = None
    """Pairs of blocks that are connected; None: all blocks are one piece."""


def look_at(
    machine: Machine,
    view: str,
    rollout: Rollout | None = None,
    times: Sequence[float] = (),
    follow: Body | None = None,
    within: float = NEAR,
) -> bytes:
    """Draw a machine as built, or at times of its rollout, as a PNG picture.

    It has 640 x 480 pixels; that of several moments has 480 x 360 for each, two in a row, at equal
    scale. Scenery is as glass where it would hide the machine.

    Args:
        machine: A file-valid machine.
        view: One of `DIRECTIONS`.
        rollout: Its rollout, if there are times.
        times: At most four, in seconds since t = 0; the nearest samples are drawn. Without any, the
            machine is drawn as built, without the scene.
        follow: A block, with whose fragment the camera moves, or a moving object of the scene;
            None: the root, with all that is near it.
        within: Blocks farther than this from it may be outside the frame, m.

    Raises:
        UsageError: The rollout has no states, or not at such a time; what the camera is to follow
            does not exist.
    """
    shapes = MachineSolids(machine)
    moments = [_Moment("as built", shapes.rest)]
    if rollout is not None and times:
        moments = [_at(rollout, time) for time in times[:MOST_MOMENTS]]
    seen = View(DIRECTIONS[view], PANEL if len(moments) > 1 else SIZE, FIELD_OF_VIEW)
    fits = [fit(_framed(shapes, each, follow, within), seen) for each in moments]
    distance = max(away for _, away in fits)
    panels = []
    for moment, (target, _) in zip(moments, fits, strict=True):
        camera = camera_at(target, distance, seen)
        panels.append(_draw(shapes, moment, camera, f"{view}, {moment.said}"))
    return content_of(tiled(panels, COLUMNS))


def _at(rollout: Rollout, time: float) -> _Moment:
    """What the sample nearest to a time shows."""
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
    return _Moment(
        f"{at:.2f} s",
        Pose.at(trace, index),
        {item.block for item in rollout.broken if item.time <= at},
        [item for item in objects if item.name in trace.objects],
        [item for item in objects if item.name not in trace.objects],
        held_pairs(trace, index),
    )


def _framed(shapes: MachineSolids, moment: _Moment, follow: Body | None, within: float) -> Array:
    """(K, 3) points that must be in the frame."""
    pose = moment.pose
    blocks = set(range(len(pose.centre)))
    if isinstance(follow, str):
        found = [item for item in moment.moving if item.name == follow]
        if not found:
            names = ", ".join(item.name for item in moment.moving) or "none is there"
            raise UsageError(
                f"no moving object is called {follow[:40]!r} ({names}); follow a block instead"
            )
        centre = np.asarray(found[0].position)
    else:
        if follow is not None and follow not in blocks:
            raise UsageError(f"there is no block {follow}; follow one from 0 to {len(blocks) - 1}")
        centre = pose.centre[follow or 0]
        if follow is not None and moment.connected is not None:
            blocks = joined_to(follow, moment.connected)
    near = np.linalg.norm(pose.centre - centre, axis=1) <= within
    shown = {f"block {block}" for block in blocks if near[block]}
    solids = [item for item in shapes.objects(pose) if item.name in shown]
    close = [item for item in moment.moving if dist(item.position, centre) <= within]
    points = [corners_of(item) for item in (*solids, *close)]
    if follow is not None:
        points.append(CORNERS * min(AROUND, 2 * within) + centre)
    return np.concatenate(points)


def _draw(shapes: MachineSolids, moment: _Moment, camera: Camera, said: str) -> Image.Image:
    """One moment, with its words."""
    solids = shapes.objects(moment.pose, moment.broken)
    picture = render_image(camera, solids, moment.moving, moment.fixed)
    _label_blocks(picture, camera, moment.pose.centre)
    draw_axes(picture, camera)
    draw_scale(picture, camera)
    caption(picture, said)
    return picture


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
