"""Films of rollouts as GIF or MP4: broken blocks in red, the path of the boulder or root dotted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from math import log
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.backdrop import LABEL_X, SCREEN, Course, Ground
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
from agentflow.env.drawing.stills import FAR, INK, caption, render_image, tiled
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.vectors import IDENTITY, Vec3
from agentflow.machine.tree import Machine

MOMENT: Size = (480, 360)
"""Size of a moment of a strip, unless one is asked for."""
IN_A_ROW = 4
"""Most moments in one row then."""
STANDING = 1.3
"""How much farther away the camera of a strip may be to stand still."""
ON_ITS_WAY = 0.02
"""How far a way along z+ may differ from a score to be what it measures: its share, and metres."""
POLE = 2.2
"""Height of the flag where a score was earned, m."""
SMOOTHING = 0.8
"""Time over which the camera's path is averaged, s."""
ENDING = 0.5
"""Time for which the start is in view again at the end, s."""
TALL, ENDLESS = 2.0, 1000.0
"""Height above which objects can hide the machine, and the height that they then count with, m."""
TRAIL = (200, 40, 30)
COLORS = 48


def save_film(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    path: Path,
    *,
    size: Size = (640, 480),
    ground: Ground = SCREEN,
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
    landing = landing_of(machine, rollout)
    last = None if landing is None else int(np.searchsorted(trace.times, landing.time - 1e-9))
    cameras = _cameras(trace, tracked_block(machine), View(back=SIDE, size=size), last)
    frames = list(_frames(machine, task, rollout, trace, dict(enumerate(cameras)), ground))
    save = save_mp4 if path.suffix == ".mp4" else _save_gif
    save(frames, path, frame_interval(trace))


def save_strip(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    path: Path,
    *,
    size: Size | None = None,
    ground: Ground = SCREEN,
    count: int = 5,
) -> None:
    """Draw moments of a rollout in rows, from its start to when its score is earned, all at one
    scale.

    Arguments are as for `save_film`; `size` is that of the whole picture.
    """
    assert rollout.trace is not None
    trace = rollout.trace.even
    tracked, landing = tracked_block(machine), landing_of(machine, rollout)
    end = trace.times[-1] if landing is None else landing.time
    last = int(np.searchsorted(trace.times, end - 1e-9).clip(max=len(trace.times) - 1))
    wanted = np.linspace(0, last, count).round().astype(int).tolist()
    across = count if count <= IN_A_ROW else -(-count // 2)
    size = size or (MOMENT[0] * across, MOMENT[1] * -(-count // across))
    rows = _rows(count, size)
    views = [View(SIDE, (size[0] // n, -(-size[1] // len(rows)))) for n in rows for _ in range(n)]
    framed = list(_framed(trace, tracked, last if tracked else None))
    points = [framed[index] for index in wanted]
    fits = [fit(each, view) for each, view in zip(points, views, strict=True)]
    away = max(distance for _, distance in fits)
    middle, most = fit(np.concatenate(points), min(views, key=lambda view: view.size[0]))
    if most <= STANDING * away:  # the camera stands still, as in one picture
        fits, away = [(middle, most)] * count, most
    cameras = dict(
        zip(
            wanted,
            (camera_at(at, away, view) for (at, _), view in zip(fits, views, strict=True)),
            strict=True,
        )
    )
    frames = _frames(machine, task, rollout, trace, cameras, ground, named=False)
    lines = [
        tiled(list(islice(frames, n)), n, (size[0], views[0].size[1]), framed=False) for n in rows
    ]
    tiled(lines, 1, size, framed=False).save(path, "PNG", optimize=True)


def _rows(count: int, size: Size) -> list[int]:
    """How many of so many pictures are in each row, so that they are nearly 4 : 3."""

    def stretch(rows: int) -> float:
        return abs(log(size[0] * rows / (-(-count // rows) * size[1] * 4 / 3)))

    best = min(range(1, count + 1), key=stretch)
    return [count * (row + 1) // best - count * row // best for row in reversed(range(best))]


def tracked_block(machine: Machine) -> int:
    """The block whose path is drawn: the boulder, or else the root."""
    return next((step.id for step in machine if library()[step.type].joint.kind == "loose"), 0)


@dataclass(frozen=True)
class Landing:
    """Where a score was earned: the first landing, or the end of the greatest distance."""

    time: float
    """s."""
    place: Vec3
    """Of the body that earned it, beside the machine if that is the root, m."""
    words: str
    """The score with its unit."""
    start: float | None
    """z from which the score counts, m; None if it is not the way along z+."""


def landing_of(machine: Machine, rollout: Rollout) -> Landing | None:
    """The landing that a film marks; None where the score is no distance, or 0."""
    trace, score = rollout.trace, rollout.score
    if trace is None or not score:
        return None
    landed = [event.time for event in rollout.events if event.kind == "landing"]
    if not landed and rollout.terms.get("distance") != score:
        return None
    time = landed[0] if landed else float(rollout.terms.get("time") or trace.times[-1])
    words = rollout.feedback.text.partition("\n")[0].removeprefix("Score: ")
    tracked = tracked_block(machine)
    paths = trace.centre[:, tracked], *np.moveaxis(trace.object_position, 1, 0)
    for path in paths:
        x, y, z = (float(np.interp(time, trace.times, axis)) for axis in path.T)
        start = float(path[0, 2])
        if abs(z - start - score) <= ON_ITS_WAY * (1.0 + score):
            beside = 0.0 if tracked or path is not paths[0] else LABEL_X - 1.0
            return Landing(time, (x + beside, y, start + score), words, start)
    index = int(np.abs(trace.times - time).argmin())
    return Landing(time, to_vec3(paths[0][index]), words, None)


def frame_interval(trace: Trace) -> float:
    """Time between two regular samples, s."""
    trace = trace.even
    return float(trace.times[1] - trace.times[0]) if len(trace.times) > 1 else 1.0


def _frames(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    trace: Trace,
    cameras: Mapping[int, Camera],
    ground: Ground = SCREEN,
    *,
    named: bool = True,
) -> Iterator[Image.Image]:
    """One picture per sample of an evenly sampled trace that has a camera; `named` tells whether
    each has the name of the task and the score."""
    assert rollout.scene is not None
    tracked, machine_solids = tracked_block(machine), MachineSolids(machine)
    landing = landing_of(machine, rollout)
    earned = float(trace.times[-1]) if landing is None else landing.time
    zero = 0.0 if landing is None or landing.start is None else landing.start
    for index, camera in cameras.items():
        time = float(trace.times[index])
        broken = {item.block for item in rollout.broken if item.time <= time}
        over = time >= earned - 1e-9
        measured = None
        if over and landing is not None and landing.start is not None:
            x, y, z = landing.place
            measured = (x, y, landing.start), (x, y, z)
        solids = machine_solids.objects(Pose.at(trace, index), broken)
        others = _remove_occluders(objects_at(rollout.scene, trace, index), camera)
        course = Course(zero, measured)
        picture = render_image(camera, solids, others, (), ground, FAR, course)
        _draw_trail(picture, camera, trace.centre[:index, tracked])
        if tracked:
            width = machine_solids.solids[tracked][0].size[0]
            _draw_speck(picture, camera, trace.centre[index, tracked], width)
        score = f"   score {rollout.score or 0.0:.2f} {task.unit}" if over else ""
        caption(picture, f"{task.name}   {time:4.1f} s{score}" if named else f"{time:.1f} s")
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


def _framed(trace: Trace, tracked: int, last: int | None = None) -> Iterator[Array]:
    """(K, 3) points that must be in each frame: of blocks near the root, of the way of a tracked
    boulder up to a last sample, and at the end, if there is one, of where the root started."""
    margin = np.array([[x, y, z] for x in (-3, 3) for y in (-1, 2) for z in (-3, 3)], dtype=float)
    for index, centre in enumerate(trace.centre):
        near = np.linalg.norm(centre - centre[0], axis=1) < 12.0
        near[tracked] &= last is None or index <= last
        flown = trace.centre[: index + 1, tracked][:last] if tracked else centre[:1]
        if not tracked and last is not None and trace.times[index] > trace.times[-1] - ENDING:
            flown = trace.centre[0, :1]
        points = np.concatenate([centre[near], flown])
        yield (points[:, None] + margin).reshape(-1, 3)


def _cameras(trace: Trace, tracked: int, view: View, last: int | None = None) -> list[Camera]:
    """One camera per sample, on a smooth path, that has in view what must be framed."""
    framed = list(_framed(trace, tracked, last))
    width = max(1, round(SMOOTHING / frame_interval(trace)))
    targets = _moving_average(np.array([fit(points, view)[0] for points in framed]), width)
    away = [fit(points, view, at=at)[1] for points, at in zip(framed, targets, strict=True)]
    most = [[max(away[max(0, i - width) : i + width + 1])] for i in range(len(away))]
    smooth = _moving_average(np.array(most), width)[:, 0]
    return [camera_at(at, float(far), view) for at, far in zip(targets, smooth, strict=True)]


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
    font, corner = ImageFont.load_default(size=size), (picture.width - size, picture.height - size)
    words = f"{landing.words} after {landing.time:.2f} s"
    left, upper, right, lower = pen.textbbox(corner, words, font=font, anchor="rb")
    gap = size / 2
    pen.rectangle((left - gap, upper - gap, right + gap, lower + gap), "white", INK, wide // 2)
    pen.text(corner, words, INK, font, "rb")


def _draw_speck(picture: Image.Image, camera: Camera, place: Array, width: float) -> None:
    """Draw a dot over a body that is `width` metres wide, if it would look smaller than the dot."""
    radius = picture.height / 120
    if camera.focal_length * width < 2 * radius * float(np.linalg.norm(place - camera.eye)):
        x, y = project(place[None], camera)[0]
        box = (x - radius, y - radius, x + radius, y + radius)
        ImageDraw.Draw(picture).ellipse(box, fill=TRAIL)
