"""Films of rollouts as GIF or MP4: broken blocks in red, the path of the boulder or root dotted."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, log
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from agentflow.env.drawing.backdrop import LABEL_X, SCREEN, Course, Ground
from agentflow.env.drawing.cameras import SIDE, Camera, Size, View, camera_at, fit, project, to_vec3
from agentflow.env.drawing.mp4 import save_mp4
from agentflow.env.drawing.solids import MachineSolids, Pose
from agentflow.env.drawing.stills import (
    FAR,
    INK,
    LETTERS,
    caption,
    in_few_colours,
    letter_size,
    render_image,
    tiled,
)
from agentflow.env.rollout import Array, Rollout, Trace
from agentflow.env.scene import Scene, SceneObject
from agentflow.env.tasks.base import Task
from agentflow.machine.blocks.library import library
from agentflow.machine.geometry.vectors import Vec3
from agentflow.machine.tree import Machine
from agentflow.progress import Progress, silent

MOMENT: Size = (480, 360)
"""Size of a moment of a strip, unless one is asked for."""
IN_A_ROW = 5
"""Most moments in one row then."""
STANDING = 1.3
"""How much farther away the camera of a strip may be to stand still."""
ON_ITS_WAY = 0.02
"""How far a way along z+ may differ from a score to be what it measures: its share, and metres."""
POLE, LEAST = 2.2, 0.08
"""Height of the flag where a score was earned, m, and its least share of a picture's height."""
MOMENT_LETTERS, COURSE_LETTERS = 12, 20
"""As `stills.LETTERS`, for a moment of a strip, and for its marks of distances."""
KEY, LEAST_SHARE = 44, 8
"""Height of the key below a strip, pixels; the share of a strip that it takes at most is 1/8."""
HELD = 2.0
"""Time for which a film shows at least what was earned, s."""
SMOOTHING = 0.8
"""Time over which the camera's path is averaged, s."""
ENDING = 0.5
"""Time for which the start is in view again at the end, s."""
NEAR, MOVING = 12.0, 20.0
"""How far from the root blocks and moving objects that must be in a frame may be, m."""
TALL = 2.0
"""Height above which walls are as glass where they would hide the machine, m."""
TRAIL = (200, 20, 20)
COLORS = 48


def save_film(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    path: Path,
    *,
    size: Size = (640, 480),
    ground: Ground = SCREEN,
    say: Progress = silent,
) -> None:
    """Film a rollout, one frame per regular sample of its trace, so that time passes evenly.

    The score appears when it is earned, and a flag marks where that was. The last frame stays
    until it could be read.

    Args:
        machine: The simulated machine.
        task: Its task.
        rollout: A rollout with a trace.
        path: File to write, `.gif` or `.mp4`.
        size: Width and height in pixels.
        ground: Colours of the ground.
        say: Receives how many frames are drawn.
    """
    assert rollout.trace is not None
    trace = rollout.trace.even
    landing = landing_of(machine, rollout)
    cameras = _cameras(trace, tracked_block(machine), View(back=SIDE, size=size), landing)
    frames = []
    for frame in _frames(machine, task, rollout, trace, enumerate(cameras), ground):
        frames.append(frame)
        say(len(frames), len(cameras))
    shown = 0.0 if landing is None else float(trace.times[-1]) - landing.time
    frames += frames[-1:] * ceil(max(0.0, HELD - shown) / frame_interval(trace))
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
    """Draw moments of a rollout in equal panels, from its start to its score, all at one
    scale, above a key of what is red.

    Arguments are as for `save_film`; `size` is that of the whole picture.
    """
    assert rollout.trace is not None
    trace = rollout.trace.even
    tracked, landing = tracked_block(machine), landing_of(machine, rollout)
    wanted = np.linspace(0, _sample_of(landing, trace), count).round().astype(int).tolist()
    columns = count if count <= IN_A_ROW else -(-count // 2)
    if size is not None:  # panels are then nearly 4 : 3
        wide = size[0] / size[1] * 3 / 4
        columns = min(range(1, count + 1), key=lambda n: abs(log(wide * -(-count // n) / n)))
    rows = -(-count // columns)
    size = size or (MOMENT[0] * columns, MOMENT[1] * rows + KEY)
    foot = min(KEY, size[1] // LEAST_SHARE)
    view = View(SIDE, (size[0] // columns, (size[1] - foot) // rows))
    framed = list(_framed(trace, tracked, landing if tracked else None))
    points = [framed[index] for index in wanted]
    fits = [fit(each, view) for each in points]
    away = max(distance for _, distance in fits)
    middle, most = fit(np.concatenate(points), view)
    if most <= STANDING * away:  # the camera stands still, as in one picture
        fits, away = [(middle, most)] * count, most
    cameras = (camera_at(at, away, view) for at, _ in fits)
    moments = zip(wanted, cameras, strict=True)
    frames = _frames(machine, task, rollout, trace, moments, ground, named=False)
    panels = tiled(list(frames), columns)
    whole = Image.new(panels.mode, size, ground.land)
    whole.paste(panels, (0, 0))
    last = float(trace.times[wanted[-1]])
    broke = any(item.time <= last for item in rollout.broken)
    name = library()[machine[tracked].type].name if tracked else "Starting Block"
    _draw_key(whole, foot, name, broke=broke, earned=landing is not None)
    whole.save(path, "PNG", optimize=True)


def tracked_block(machine: Machine) -> int:
    """The block whose path is drawn: the boulder, or else the root."""
    return next((step.id for step in machine if library()[step.type].joint.kind == "loose"), 0)


@dataclass(frozen=True)
class Landing:
    """Where a score was earned: the first landing, or the end of the greatest distance. m, s.

    `place` is that of the body that earned it, beside the machine if that is the root, and `words`
    are the score with its unit. The score counts from z = `start`; None if it is not the way along
    z+.
    """

    time: float
    place: Vec3
    words: str
    start: float | None


def landing_of(machine: Machine, rollout: Rollout) -> Landing | None:
    """The landing that a film marks; None where the score is no distance, or 0."""
    trace, score = rollout.trace, rollout.score
    if trace is None or not score:
        return None
    landed = [event.time for event in rollout.events if event.kind == "landing"]
    if not landed and rollout.terms.get("distance") != score:
        return None
    time = float(rollout.terms.get("time") or (landed or trace.times[-1:])[0])
    tracked = tracked_block(machine)
    paths = trace.centre[:, tracked], *np.moveaxis(trace.object_position, 1, 0)
    for path in paths:
        x, y, z = (float(np.interp(time, trace.times, axis)) for axis in path.T)
        start = float(path[0, 2])
        if abs(z - start - score) <= ON_ITS_WAY * (1.0 + score):
            beside = 0.0 if tracked or path is not paths[0] else LABEL_X - 1.0
            return Landing(time, (x + beside, y, start + score), _words(rollout), start)
    index = int(np.abs(trace.times - time).argmin())
    return Landing(time, to_vec3(paths[0][index]), _words(rollout), None)


def _words(rollout: Rollout) -> str:
    """The score with its unit."""
    return rollout.feedback.text.partition("\n")[0].removeprefix("Score: ")


def frame_interval(trace: Trace) -> float:
    """Time between two regular samples, s."""
    trace = trace.even
    return float(trace.times[1] - trace.times[0]) if len(trace.times) > 1 else 1.0


def _frames(
    machine: Machine,
    task: Task,
    rollout: Rollout,
    trace: Trace,
    cameras: Iterable[tuple[int, Camera]],
    ground: Ground = SCREEN,
    *,
    named: bool = True,
) -> Iterator[Image.Image]:
    """One picture for each index of a sample of an evenly sampled trace, with its camera; `named`
    tells whether each has the name of the task."""
    assert rollout.scene is not None
    tracked, machine_solids = tracked_block(machine), MachineSolids(machine)
    landing = landing_of(machine, rollout)
    earned = float(trace.times[-1]) if landing is None else landing.time
    zero = 0.0 if landing is None or landing.start is None else landing.start
    words = _words(rollout)
    name, letters = (f"{task.name}   ", LETTERS) if named else ("", MOMENT_LETTERS)
    card = f"Score {words}" if landing is None else f"{words} after {earned:.2f} s"

    def mark(index: int, picture: Image.Image, camera: Camera) -> None:
        time, path = float(trace.times[index]), trace.centre[: index + 1, tracked]
        _draw_trail(picture, camera, path[:-1])
        if tracked:
            _draw_speck(picture, camera, path[-1], machine_solids.solids[tracked][0].size[0])
        if time >= earned - 1e-9:
            if landing is not None:
                _draw_flag(picture, camera, landing.place)
            _draw_card(picture, card, letters)
        caption(picture, f"{name}{time:.2f} s", letters)

    for index, camera in cameras:
        time = float(trace.times[index])
        broken = {item.block for item in rollout.broken if item.time <= time}
        over = time >= earned - 1e-9
        measured = None
        if over and landing is not None and landing.start is not None:
            x, y, z = landing.place
            measured = (x, y, landing.start), (x, y, z)
        solids = machine_solids.objects(Pose.at(trace, index), broken)
        root = float(trace.centre[index, 0, 1])
        walls, others = list[SceneObject](), list[SceneObject]()
        for item in objects_at(rollout.scene, trace, index):
            wall = item.name not in trace.objects and _is_wall(item, root)
            (walls if wall else others).append(item)
        course = Course(zero, measured) if named else Course(zero, measured, COURSE_LETTERS)
        yield render_image(camera, solids, others, walls, ground, FAR, course, partial(mark, index))


def _save_gif(frames: Sequence[Image.Image], path: Path, interval: float) -> None:
    few = [in_few_colours(frame, COLORS) for frame in frames]
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


def _is_wall(item: SceneObject, root: float) -> bool:
    """Whether an object is tall, and not what the root, which is so high, stands on."""
    return item.size[1] > TALL and item.position[1] + item.size[1] / 2 > root


def _framed(trace: Trace, tracked: int, landing: Landing | None = None) -> Iterator[Array]:
    """(K, 3) points that must be in each frame: of bodies near the root, of the way of a tracked
    boulder up to its landing, and else, where the film ends with one, of the whole way to it."""
    margin = np.array([[x, y, z] for x in (-3, 3) for y in (-1, 2) for z in (-3, 3)], dtype=float)
    last = _sample_of(landing, trace)
    for index, centre in enumerate(trace.centre):
        bodies = np.concatenate([centre, trace.object_position[index]])
        reach = np.where(np.arange(len(bodies)) < len(centre), NEAR, MOVING)
        near = np.linalg.norm(bodies - centre[0], axis=1) < reach
        near[tracked] &= index <= last
        flown = trace.centre[: index + 1, tracked][:last] if tracked else centre[:1]
        ending = trace.times[index] > trace.times[-1] - ENDING
        if not tracked and landing is not None and ending:
            flown = np.array([trace.centre[0, 0], landing.place])
        points = np.concatenate([bodies[near], flown])
        yield (points[:, None] + margin).reshape(-1, 3)


def _sample_of(landing: Landing | None, trace: Trace) -> int:
    """Index of the first sample with a landing; that of the last one where there is none."""
    time = trace.times[-1] if landing is None else landing.time
    return min(len(trace.times) - 1, int(np.searchsorted(trace.times, time - 1e-9)))


def _cameras(
    trace: Trace, tracked: int, view: View, landing: Landing | None = None
) -> list[Camera]:
    """One camera per sample, on a smooth path, that has in view what must be framed."""
    framed = list(_framed(trace, tracked, landing))
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
    """Draw a path as dots with light rims, which show on any ground."""
    pen, radius = ImageDraw.Draw(picture), max(4, picture.height / 200)
    seen = [place for place in project(trail, camera).tolist() if np.isfinite(place).all()]
    for size, color in ((1.5 * radius, "white"), (radius, TRAIL)):
        for place in seen:
            pen.circle(place, size, color)


def _draw_flag(picture: Image.Image, camera: Camera, place: Vec3) -> None:
    """Draw a pole where a score was earned."""
    x, _, z = place
    foot, top = project(np.array([(x, 0.0, z), (x, POLE, z)]), camera)
    if not np.isfinite([foot, top]).all():
        return
    pen, wide = ImageDraw.Draw(picture), max(2, picture.height // 200)
    top = foot + (top - foot) * max(1.0, LEAST * picture.height / float(np.hypot(*(top - foot))))
    cloth = (wide * np.array([(0, 0), (9, 3), (0, 6)]) + top).ravel().tolist()
    for rim, color in ((2 * wide, "white"), (0, INK)):
        pen.line((*foot, *top), color, wide + rim)
    pen.line((*cloth, *cloth[:2]), "white", wide)
    pen.polygon(cloth, TRAIL)


def _draw_card(picture: Image.Image, words: str, letters: int) -> None:
    """Draw a card with what was earned, the picture as many letters high as given."""
    pen, size = ImageDraw.Draw(picture), letter_size(picture, words, letters)
    font, corner = ImageFont.load_default(size=size), (picture.width - size, picture.height - size)
    left, upper, right, lower = pen.textbbox(corner, words, font=font, anchor="rb")
    box = (left - size / 2, upper - size / 2, right + size / 2, lower + size / 2)
    pen.rectangle(box, "white", INK, max(1, size // 16))
    pen.text(corner, words, INK, font, "rb")


def _draw_key(picture: Image.Image, foot: int, tracked: str, *, broke: bool, earned: bool) -> None:
    """Say in the lowest lines of a picture what is red: dots, blocks and flags."""
    words = [
        f"path of the {tracked}",
        "block that broke off" * broke,
        "where the score was earned" * earned,
    ]
    shown = [(kind, text) for kind, text in enumerate(words) if text]
    size = 0.55 * foot
    wide = ImageFont.load_default(size=size).getlength("".join(words)) + 3 * size * len(shown)
    size *= min(1.0, (picture.width - size) / wide)
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(size=size)
    x, y, half = size / 2, picture.height - foot / 2, size / 3
    for kind, text in shown:
        if kind == 0:
            for step in range(3):
                pen.circle((x + half * step, y), max(1.0, size / 9), TRAIL)
        elif kind == 1:
            pen.rectangle((x, y - half, x + 2 * half, y + half), TRAIL)
        else:
            pen.line((x, y - half, x, y + half), INK, max(1, round(size / 12)))
            pen.polygon((x, y - half, x + 2 * half, y - half / 3, x, y + half / 3), TRAIL)
        pen.text((x + size, y), text, INK, font, "lm")
        x += font.getlength(text) + 3 * size


def _draw_speck(picture: Image.Image, camera: Camera, place: Array, width: float) -> None:
    """Draw a dot over a body that is `width` metres wide, if it would look smaller than the dot."""
    radius = picture.height / 120
    if camera.focal_length * width < 2 * radius * float(np.linalg.norm(place - camera.eye)):
        x, y = project(place[None], camera)[0]
        ImageDraw.Draw(picture).circle((x, y), radius, TRAIL, "white", round(radius / 4))
