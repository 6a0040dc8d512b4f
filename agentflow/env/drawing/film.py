"""Films of rollouts as GIF or MP4: broken blocks in red, the path of the boulder or root dotted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.backdrop import FILM, Ground
from agentflow.env.drawing.cameras import (
    SIDE,
    Camera,
    Size,
    View,
    camera_at,
    fit,
    project,
    to_vec3,
)
from agentflow.env.drawing.mp4 import save_mp4
from agentflow.env.drawing.solids import MachineSolids, Pose
from agentflow.env.drawing.stills import GRID, INK, caption, render_image, tiled
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.vectors import IDENTITY, Vec3
from agentflow.machine.tree import Machine

POLE = 2.2
"""Height of the flag where a score was earned, m."""
ASPECT = 4 / 3
"""Width of a moment of a strip, in heights."""
SMOOTHING = 0.8
"""Time over which the camera's path is averaged, s."""
TALL, ENDLESS = 2.0, 1000.0
"""Height above which objects can hide the machine, and the height that they then count with, m."""
TRAIL = (200, 40, 30)
COLORS = 96


def save_film(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    path: Path,
    *,
    size: Size = (640, 480),
    ground: Ground = FILM,
) -> None:
    """Film a rollout, one frame per regular sample of its trace, so that time passes evenly.

    The score appears when it is earned, and a flag marks where that was.

    Args:
        machine: The simulated machine.
        task: Its task.
        rollout: A rollout with a trace.
        path: File to write, `.gif` or `.mp4`.
        size: Width and height in pixels.
        ground: Colours of the ground.
    """
    assert rollout.trace is not None
    trace = rollout.trace.even
    frames = list(_frames(machine, task, rollout, trace, size, ground))
    save = save_mp4 if path.suffix == ".mp4" else _save_gif
    save(frames, path, frame_interval(trace))


def save_strip(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    path: Path,
    *,
    size: Size = (2400, 360),
    ground: Ground = FILM,
    count: int = 5,
) -> None:
    """Draw moments of a rollout side by side, from its start to when its score is earned.

    Arguments are as for `save_film`; the size is that of the whole, which has as many rows as make
    its parts most like `ASPECT`. One camera sees all that happens.
    """
    assert rollout.trace is not None
    trace = rollout.trace.even
    landing = landing_of(machine, rollout)
    end = trace.times[-1] if landing is None else landing.time
    last = int(np.searchsorted(trace.times, end - 1e-9).clip(max=len(trace.times) - 1))
    wanted = np.linspace(0, last, count).round().astype(int).tolist()
    shapes = [(-(-count // rows), rows) for rows in range(1, count + 1)]
    columns, rows = min(shapes, key=lambda s: abs(np.log(size[0] * s[1] / s[0] / size[1] / ASPECT)))
    part = (size[0] // columns, size[1] // rows)
    frames = list(_frames(machine, task, rollout, trace, part, ground, wanted))
    tiled(frames, columns, framed=False).save(path, "PNG", optimize=True)


def tracked_block(machine: Machine) -> int:
    """The block whose path is drawn: the boulder, or else the root."""
    return next((step.id for step in machine if library()[step.type].joint.kind == "loose"), 0)


@dataclass(frozen=True)
class Landing:
    """Where a score was earned: the first landing, or the end of the greatest distance."""

    time: float
    """s."""
    place: Vec3
    """Of the tracked block, m."""
    words: str
    """The score with its unit."""
    origin: float
    """z from which distance marks count: where the score is 0, if it is a distance along z; m."""


def landing_of(machine: Machine, rollout: Rollout) -> Landing | None:
    """The landing that a film marks; None where the score is no distance, or 0."""
    trace, score = rollout.trace, rollout.score
    if trace is None or not score:
        return None
    landed = [event.time for event in rollout.events if event.kind == "landing"]
    if not landed and rollout.terms.get("distance") != score:
        return None
    time = landed[0] if landed else float(rollout.terms.get("time") or trace.times[-1])
    index = int(np.abs(trace.times - time).argmin())
    words = rollout.feedback.text.partition("\n")[0].removeprefix("Score: ")
    place = to_vec3(trace.centre[index, tracked_block(machine)])
    start = float(trace.centre[int(np.abs(trace.times).argmin()), tracked_block(machine), 2])
    origin = place[2] - score
    return Landing(time, place, words, origin if abs(origin - start) < POLE else 0.0)


def frame_interval(trace: Trace) -> float:
    """Time between two regular samples, s."""
    trace = trace.even
    return float(trace.times[1] - trace.times[0]) if len(trace.times) > 1 else 1.0


def _frames(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    trace: Trace,
    size: Size,
    ground: Ground = FILM,
    wanted: Iterable[int] | None = None,
) -> Iterator[Image.Image]:
    """One picture per sample of an evenly sampled trace, or per wanted index."""
    assert rollout.scene is not None
    tracked, machine_solids = tracked_block(machine), MachineSolids(machine)
    landing = landing_of(machine, rollout)
    earned = float(trace.times[-1]) if landing is None else landing.time
    view, indices = View(back=SIDE, size=size), [*(wanted or range(len(trace.times)))]
    cameras = _cameras(trace, tracked, view, None if wanted is None else indices[-1])
    for index in indices:
        camera, time = cameras[index], float(trace.times[index])
        broken = {item.block for item in rollout.broken if item.time <= time}
        solids = machine_solids.objects(Pose.at(trace, index), broken)
        others = _remove_occluders(objects_at(rollout.scene, trace, index), camera)
        picture = render_image(
            camera, solids, others, GRID, ground=ground, origin=landing.origin if landing else 0.0
        )
        _draw_trail(picture, camera, trace.centre[:index, tracked])
        if tracked:
            width = machine_solids.solids[tracked][0].size[0]
            _draw_speck(picture, camera, trace.centre[index, tracked], width)
        over = time >= earned - 1e-9
        score = f"   score {rollout.score or 0.0:.2f} {task.unit}" if over else ""
        caption(picture, f"{task.name}   {time:4.1f} s{score}")
        if over and landing is not None:
            _draw_flag(picture, camera, landing)
        yield picture


def _save_gif(frames: Sequence[Image.Image], path: Path, interval: float) -> None:
    few = [frame.quantize(COLORS, dither=Image.Dither.NONE) for frame in frames]
    few[0].save(
        path,
        "GIF",
        save_all=True,
        append_images=few[1:],
        duration=round(1000 * interval),
        loop=0,
        optimize=False,
    )


def objects_at(scene: Scene, trace: Trace, index: int) -> list[SceneObject]:
    """The scene's objects where they are in one sample."""
    moved = []
    for item in scene.objects:
        if item.name in trace.objects:
            column = trace.objects.index(item.name)
            x, y, z = trace.object_position[index, column].tolist()
            a, b, c, w = trace.object_rotation[index, column].tolist()
            item = replace(item, position=(x, y, z), rotation=(a, b, c, w))
        moved.append(replace(item, mass=0.0))
    return moved


def _remove_occluders(objects: Sequence[SceneObject], camera: Camera) -> list[SceneObject]:
    """Leave out tall objects between the eye and its target (or the ground below it); objects on
    which the target stands stay."""
    eye = np.asarray(camera.eye)
    way = np.array([camera.target[0], 0.0, camera.target[2]]) - eye
    kept = []
    for item in objects:
        middle, half = np.asarray(item.position), np.asarray(item.size) / 2
        half[1] = ENDLESS  # even if the eye looks over them: they hide what is close behind them
        bounds = np.sort(np.stack([middle - half - eye, middle + half - eye]) / way, axis=0)
        enters, leaves = float(bounds[0].max()), float(bounds[1].min())
        low = item.size[1] <= TALL or item.rotation != IDENTITY
        if low or enters > leaves or enters < 0.0 or leaves > 1.0:
            kept.append(item)
    return kept


def _cameras(trace: Trace, tracked: int, view: View, last: int | None = None) -> list[Camera]:
    """One camera per sample that keeps blocks near the root and the tracked block in view; up to
    the sample `last`, if it is given, always the same one."""
    margin = np.array([[x, y, z] for x in (-3, 3) for y in (-1, 2) for z in (-3, 3)], dtype=float)
    seen = []
    for centre in trace.centre:
        near = np.linalg.norm(centre - centre[0], axis=1) < 12.0
        points = np.concatenate([centre[near], centre[[tracked]]])
        seen.append((points[:, None] + margin).reshape(-1, 3))
    if last is not None:
        same = fit(np.concatenate(seen[: last + 1]), view)
        return [camera_at(*same, view)] * len(seen)
    poses = [fit(points, view) for points in seen]
    path = np.array([[*target, distance] for target, distance in poses])
    smooth = _moving_average(path, max(1, round(SMOOTHING / frame_interval(trace))))
    return [camera_at(row[:3], float(row[3]), view) for row in smooth]


def _moving_average(path: Array, width: int) -> Array:
    """Moving average over `width` rows on either side."""
    padded = np.pad(path, ((width, width), (0, 0)), mode="edge")
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    columns = [np.convolve(column, kernel, mode="valid") for column in padded.T]
    return np.stack(columns, axis=1)


def _draw_trail(picture: Image.Image, camera: Camera, trail: Array) -> None:
    pen, radius = ImageDraw.Draw(picture), picture.height / 240
    for x, y in project(trail, camera):
        if np.isfinite(x):
            pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=TRAIL)


def _draw_flag(picture: Image.Image, camera: Camera, landing: Landing) -> None:
    """Draw a pole where a score was earned, and a card with the score and its time."""
    x, _, z = landing.place
    (foot, top) = project(np.array([(x, 0.0, z), (x, POLE, z)]), camera)
    pen, wide = ImageDraw.Draw(picture), max(2, picture.height // 200)
    if np.isfinite([foot, top]).all():
        pen.line((*foot, *top), fill=INK, width=wide)
        cloth = wide * np.array([(0, 0), (9, 3), (0, 6)]) + top
        pen.polygon(cloth.ravel().tolist(), TRAIL)
    size = max(14, picture.height // 18)
    font, where = ImageFont.load_default(size=size), (picture.width / 2, picture.height - 2 * size)
    words = f"{landing.words} after {landing.time:.2f} s"
    left, upper, right, lower = pen.textbbox(where, words, font=font, anchor="mm")
    gap = size / 2
    pen.rectangle((left - gap, upper - gap, right + gap, lower + gap), "white", INK, wide // 2)
    pen.text(where, words, INK, font, "mm")


def _draw_speck(picture: Image.Image, camera: Camera, place: Array, width: float) -> None:
    """Draw a dot over a body that is `width` metres wide, if it would look smaller than the dot."""
    radius = picture.height / 120
    if camera.focal_length * width < 2 * radius * float(np.linalg.norm(place - camera.eye)):
        x, y = project(place[None], camera)[0]
        box = (x - radius, y - radius, x + radius, y + radius)
        ImageDraw.Draw(picture).ellipse(box, fill=TRAIL)
