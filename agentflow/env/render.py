"""Owns pictures: a PNG of a machine as built, a GIF of a rollout.

Every frame is posed from the trace and drawn by the engine's software renderer, without a display;
marks and captions are drawn over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.backdrop import backdrop, bare_ground
from agentflow.env.engines.base import Assembly, Camera, Part
from agentflow.env.engines.pybullet import PyBulletEngine
from agentflow.env.figures import Figures, Pose
from agentflow.env.rollout import simulate
from agentflow.env.scene import IDENTITY, Scene, Thing
from agentflow.env.tasks.base import Task
from agentflow.env.trace import Array, Rollout, Trace
from agentflow.env.views import SIDE, Size, View, camera_at, fit, project
from agentflow.errors import UsageError
from agentflow.machine.blocks import BOULDER
from agentflow.machine.tree import Machine

RATE = 120.0
HIDDEN = (0.0, -50.0, 0.0)
NOBODY = Assembly(
    parts=(Part(0, HIDDEN, 1.0, (1.0, 1.0, 1.0)),),
    joints=(),
    pulls=(),
    blocks=((0,),),
    origins=(HIDDEN,),
    centres=(HIDDEN,),
    rotations=(IDENTITY,),
)
"""A machine below the ground: what is seen are things of the scene."""
GRID = 5.0
"""Metres between the lines on the ground of a film."""
SMOOTHING = 0.8
"""Seconds over which the camera's path is averaged."""
TALL, TALLER = 2.0, 1000.0
TRAIL = (200, 40, 30)
INK = (30, 32, 36)
COLORS = 96


def render_png(machine: Machine, path: Path, *, size: Size = (800, 600)) -> None:
    """A three-quarter view of a machine as built, filling the picture.

    Args:
        machine: Machine-valid.
        size: Width and height in pixels.
    """
    figures = Figures(machine)
    solids = figures.things(figures.rest)
    view = View(size=(2 * size[0], 2 * size[1]))
    target, distance = fit(_corners(solids), view)
    with closing(Studio()) as studio:
        picture = studio.shoot(camera_at(target, distance, view), solids, (), spacing=1.0)
    picture.resize(size, Image.Resampling.LANCZOS).save(path, optimize=True)


def render_gif(
    machine: Machine,
    task: Task,
    path: Path,
    *,
    seed: int = 0,
    fps: int = 10,
    size: Size = (480, 360),
) -> Rollout:
    """Simulate the machine again and film it: broken blocks red, the projectile's path dotted.

    Raises:
        UsageError: The machine cannot be simulated; the message says why.
    """
    rollout = simulate(machine, task, seed=seed, interval=1.0 / fps)
    if rollout.trace is None:
        why = "; ".join(str(problem["message"]) for problem in rollout.problems)
        raise UsageError(f"nothing to film, the rollout ended as {rollout.status}: {why}")
    frames = _film(machine, task, rollout, rollout.trace, size)
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 / fps),
        loop=0,
        optimize=False,
    )
    return rollout


def _film(
    machine: Machine, task: Task, rollout: Rollout, trace: Trace, size: Size
) -> list[Image.Image]:
    """One picture per sample of the trace."""
    hero = next((step.id for step in machine if step.type == BOULDER), 0)
    figures, scene, frames = Figures(machine), task.scene(), []
    with closing(Studio()) as studio:
        for index, camera in enumerate(_cameras(trace, hero, View(back=SIDE, size=size))):
            time = float(trace.times[index])
            red = {item.block for item in rollout.broken if item.time <= time}
            alive = set(np.flatnonzero(trace.alive[index]).tolist())
            solids = figures.things(Pose(trace.centre[index], trace.rotation[index], alive), red)
            others = _unhidden(_things_at(scene, trace, index), camera)
            picture = studio.shoot(camera, solids, others, GRID)
            _mark(picture, camera, trace.centre[:index, hero])
            _caption(picture, f"{task.name}   {time:4.1f} s   score {rollout.score or 0.0:.1f}")
            frames.append(picture.quantize(COLORS, dither=Image.Dither.NONE))
    return frames


class Studio:
    """An engine that only draws, one scene at a time."""

    def __init__(self) -> None:
        self._engine = PyBulletEngine()
        self._engine.build(NOBODY, Scene(), RATE, visible=True)
        above = Camera(eye=(0.0, 20.0, -1.0), target=(0.0, 0.0, 0.0), width=8, height=8)
        self._ground = self._engine.render(above)[4, 4]

    def close(self) -> None:
        """Give the engine back."""
        self._engine.close()

    def shoot(
        self, camera: Camera, solids: Sequence[Thing], others: Sequence[Thing], spacing: float
    ) -> Image.Image:
        """A picture of the solids (which cast shadows) and the other things on a lined ground."""
        self._engine.build(NOBODY, Scene((*others, *solids)), RATE, visible=True)
        pixels = self._engine.render(camera)
        ground = backdrop(camera, solids, spacing)
        return Image.composite(ground, Image.fromarray(pixels), bare_ground(pixels, self._ground))


def _corners(solids: Sequence[Thing]) -> Array:
    """(K, 3) points that bound the solids, generously."""
    centres = np.array([thing.position for thing in solids])
    reach = np.array([max(thing.size) / 2 for thing in solids])[:, None]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.7
    corners: Array = (centres[:, None, :] + reach[:, :, None] * signs).reshape(-1, 3)
    return corners


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
    """The things that do not stand before the camera's target or the ground below it.

    Tall ones are left out also when the camera looks over them: they hide what is near them.
    """
    eye = np.asarray(camera.eye)
    way = np.array([camera.target[0], 0.0, camera.target[2]]) - eye
    kept = []
    for thing in things:
        middle, half = np.asarray(thing.position), np.asarray(thing.size) / 2
        half[1] += TALLER if thing.size[1] > TALL else 0.0
        bounds = np.sort(np.stack([middle - half - eye, middle + half - eye]) / way, axis=0)
        enters, leaves = float(bounds[0].max()), float(bounds[1].min())
        if thing.rotation != IDENTITY or enters > leaves or not 0.0 < enters < 1.0:
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
    interval = float(trace.times[1] - trace.times[0]) if len(trace.times) > 1 else 1.0
    smooth = _averaged(path, max(1, round(SMOOTHING / interval)))
    return [camera_at(row[:3], float(row[3]), view) for row in smooth]


def _averaged(path: Array, width: int) -> Array:
    """Moving average over `width` rows on either side."""
    padded = np.pad(path, ((width, width), (0, 0)), mode="edge")
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    columns = [np.convolve(column, kernel, mode="valid") for column in padded.T]
    return np.stack(columns, axis=1)


def _mark(picture: Image.Image, camera: Camera, trail: Array) -> None:
    pen = ImageDraw.Draw(picture)
    for x, y in project(trail, camera):
        if np.isfinite(x):
            pen.ellipse((x - 2, y - 2, x + 2, y + 2), fill=TRAIL)


def _caption(picture: Image.Image, text: str) -> None:
    pen = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=max(12, picture.height // 24))
    pen.text((10, 8), text, fill=INK, font=font)
