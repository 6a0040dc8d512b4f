"""Owns films of rollouts: broken blocks red, the path of what is scored dotted; GIF or MP4.

Every frame is posed from the trace, so nothing is simulated here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from agentflow.env.drawing.cameras import SIDE, Camera, Size, View, camera_at, fit, project
from agentflow.env.drawing.figures import Figures, Pose
from agentflow.env.drawing.mp4 import save_mp4
from agentflow.env.drawing.stills import caption, shoot
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.scene import IDENTITY, Scene, Thing
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.tree import Machine

GRID = 5.0
"""Metres between the lines on the ground."""
SMOOTHING = 0.8
"""Seconds over which the camera's path is averaged."""
TALL, TALLER = 2.0, 1000.0
TRAIL = (200, 40, 30)
COLORS = 96


def save_film(
    machine: Machine, task: Task, rollout: Rollout, path: Path, *, size: Size = (640, 480)
) -> None:
    """Film a rollout, one frame per sample of its trace; the path's ending says how it is kept.

    Args:
        machine: What was simulated.
        task: At what.
        rollout: With a trace, whose samples are equally far apart.
        path: `.gif` or `.mp4`.
        size: Width and height in pixels.
    """
    assert rollout.trace is not None
    frames = _frames(machine, task, rollout, rollout.trace, size)
    if path.suffix == ".mp4":
        save_mp4(list(frames), path, interval_of(rollout.trace))
    else:
        _save_gif(list(frames), path, interval_of(rollout.trace))


def hero_of(machine: Machine) -> int:
    """The block whose path is marked: the boulder, or else the root."""
    return next((step.id for step in machine if library()[step.type].joint.kind == "loose"), 0)


def interval_of(trace: Trace) -> float:
    """Seconds from one sample to the next."""
    return float(trace.times[1] - trace.times[0]) if len(trace.times) > 1 else 1.0


def broken_at(rollout: Rollout, time: float) -> set[int]:
    """Blocks whose connection has given way by then."""
    return {item.block for item in rollout.broken if item.time <= time}


def _frames(
    machine: Machine, task: Task, rollout: Rollout, trace: Trace, size: Size
) -> Iterator[Image.Image]:
    """One picture per sample of the trace."""
    assert rollout.scene is not None
    hero, figures = hero_of(machine), Figures(machine)
    for index, camera in enumerate(_cameras(trace, hero, View(back=SIDE, size=size))):
        time = float(trace.times[index])
        alive = set(np.flatnonzero(trace.alive[index]).tolist())
        pose = Pose(trace.centre[index], trace.rotation[index], alive)
        solids = figures.things(pose, broken_at(rollout, time))
        others = _unhidden(_things_at(rollout.scene, trace, index), camera)
        picture = shoot(camera, solids, others, GRID)
        _mark(picture, camera, trace.centre[:index, hero])
        caption(picture, f"{task.name}   {time:4.1f} s   score {rollout.score or 0.0:.1f}")
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


def _things_at(scene: Scene, trace: Trace, index: int) -> list[Thing]:
    """The scene's things where they are in one sample."""
    moved = []
    for thing in scene.things:
        if thing.name in trace.things:
            column = trace.things.index(thing.name)
            x, y, z = trace.thing_position[index, column].tolist()
            a, b, c, w = trace.thing_rotation[index, column].tolist()
            thing = replace(thing, position=(x, y, z), rotation=(a, b, c, w))
        moved.append(replace(thing, mass=0.0))
    return moved


def _unhidden(things: Sequence[Thing], camera: Camera) -> list[Thing]:
    """The things, without tall ones between the eye and what it looks at (or the ground below)."""
    eye = np.asarray(camera.eye)
    way = np.array([camera.target[0], 0.0, camera.target[2]]) - eye
    kept = []
    for thing in things:
        middle, half = np.asarray(thing.position), np.asarray(thing.size) / 2
        half[1] = TALLER  # also where the eye looks over them: they hide what is near them
        bounds = np.sort(np.stack([middle - half - eye, middle + half - eye]) / way, axis=0)
        enters, leaves = float(bounds[0].max()), float(bounds[1].min())
        low = thing.size[1] <= TALL or thing.rotation != IDENTITY
        if low or enters > leaves or not 0.0 < enters < 1.0:
            kept.append(thing)
    return kept


def _cameras(trace: Trace, hero: int, view: View) -> list[Camera]:
    """One camera per sample that keeps the root's surroundings and the hero in the picture."""
    margin = np.array([[x, y, z] for x in (-3, 3) for y in (-1, 2) for z in (-3, 3)], dtype=float)
    poses = []
    for centre in trace.centre:
        near = np.linalg.norm(centre - centre[0], axis=1) < 12.0
        points = np.concatenate([centre[near], centre[[hero]]])
        poses.append(fit((points[:, None] + margin).reshape(-1, 3), view))
    path = np.array([[*target, distance] for target, distance in poses])
    smooth = _averaged(path, max(1, round(SMOOTHING / interval_of(trace))))
    return [camera_at(row[:3], float(row[3]), view) for row in smooth]


def _averaged(path: Array, width: int) -> Array:
    """Moving average over `width` rows on either side."""
    padded = np.pad(path, ((width, width), (0, 0)), mode="edge")
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    columns = [np.convolve(column, kernel, mode="valid") for column in padded.T]
    return np.stack(columns, axis=1)


def _mark(picture: Image.Image, camera: Camera, trail: Array) -> None:
    pen, radius = ImageDraw.Draw(picture), picture.height / 240
    for x, y in project(trail, camera):
        if np.isfinite(x):
            pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=TRAIL)
