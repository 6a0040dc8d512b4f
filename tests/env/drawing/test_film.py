"""Films: a frame per sample, what is broken is red from then on, the path is dotted."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from agentflow.env.drawing import backdrop, film
from agentflow.env.drawing.backdrop import SCREEN
from agentflow.env.drawing.cameras import SIDE, View, camera_at, fit, project
from agentflow.env.drawing.film import save_film
from agentflow.env.drawing.mp4 import save_mp4
from agentflow.env.rollout import Broken, Rollout, RolloutEvent
from agentflow.env.scene import SceneObject
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.registry import get_task
from agentflow.machine.tree import Machine
from tests.env.drawing.mp4boxes import boxes_of
from tests.env.far_throw import far_throw
from tests.env.machines import CAR

SIZE = (120, 90)


@cache
def drive() -> tuple[Task, Rollout]:
    task = get_task("movement", {"window": 1})
    rollout = simulate(CAR, task, interval=0.2)
    assert rollout.trace is not None
    return task, rollout


def frames_of(
    machine: Machine, task: Task, rollout: Rollout, size: tuple[int, int]
) -> list[Image.Image]:
    assert rollout.trace is not None
    view = View(back=SIDE, size=size)
    cameras = film._cameras(rollout.trace, film.tracked_block(machine), view)
    return list(film._frames(machine, task, rollout, rollout.trace, enumerate(cameras)))


def reds(rollout: Rollout) -> list[int]:
    """How many red pixels each frame has: at 0, 0.2, 0.4, 0.6, 0.8 and 1 s."""
    assert rollout.trace is not None
    counts = []
    for frame in frames_of(CAR, drive()[0], rollout, (320, 240)):
        pixels = np.asarray(frame).astype(np.int64)
        counts.append(int((pixels[:, :, 0] > 90 + pixels[:, :, 1:].max(axis=2)).sum()))
    return counts


def test_a_gif_has_one_frame_per_sample(tmp_path: Path) -> None:
    task, rollout = drive()
    told = list[tuple[int, int]]()
    say = lambda done, of: told.append((done, of))  # noqa: E731
    save_film(CAR, task, rollout, tmp_path / "car.gif", size=SIZE, say=say)
    assert told == [(frame, 6) for frame in range(1, 7)]
    with Image.open(tmp_path / "car.gif") as picture:
        assert (picture.size, getattr(picture, "n_frames", 1)) == (SIZE, 6)
        assert picture.info["duration"] == 200


def test_an_mp4_has_one_frame_per_sample(tmp_path: Path) -> None:
    task, rollout = drive()
    path = tmp_path / "car.mp4"
    save_film(CAR, task, rollout, path, size=SIZE)
    boxes = boxes_of(path.read_bytes())
    assert boxes["ftyp"][:4] == b"iso8"
    assert boxes["hdlr"][8:12] == b"vide"
    assert int.from_bytes(boxes["stsz"][8:12], "big") == 6 + 10  # the last one for 2 s more
    assert b"av01" in boxes["stsd"]
    milliseconds = [int.from_bytes(boxes["mvhd"][24:32], "big")]
    milliseconds.append(int.from_bytes(boxes["tkhd"][28:36], "big"))
    milliseconds.append(int.from_bytes(boxes["mdhd"][24:32], "big"))
    assert milliseconds == [3200, 3200, 3200]
    assert boxes["tkhd"][-8:] == (120 << 16).to_bytes(4, "big") + (90 << 16).to_bytes(4, "big")
    assert not {"meta", "edts"} & set(boxes)


def test_sixty_frames_a_second_last_as_long_as_they_should(tmp_path: Path) -> None:
    save_mp4([Image.new("RGB", (64, 48))] * 6, tmp_path / "x.mp4", 1 / 60)
    head = boxes_of((tmp_path / "x.mp4").read_bytes())["mdhd"]
    ticks, length = int.from_bytes(head[20:24], "big"), int.from_bytes(head[24:32], "big")
    assert length / ticks == 0.1


def test_a_score_is_told_with_a_flag_once_it_is_earned_and_in_the_last_moment_of_a_strip(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task, rollout = drive()
    landing = film.landing_of(CAR, rollout)
    assert landing is not None
    assert (landing.time, landing.words) == (1.0, f"{rollout.score:.2f} m")
    assert landing.place[2] == pytest.approx(rollout.score, abs=0.01)
    assert landing.start == pytest.approx(0.0, abs=0.01)
    film.save_strip(CAR, task, rollout, tmp_path / "x.png", size=(360, 90), count=3)
    strip = np.asarray(Image.open(tmp_path / "x.png"))
    assert strip.shape == (90, 360, 3)
    lower = np.split(strip[45:], 3, axis=1)
    cards = [(tile == 255).all(axis=2).sum() > 200 for tile in lower]
    assert cards == [False, False, True]
    monkeypatch.setattr(film, "_sample_of", lambda *_: 1)  # earned before there are as many samples
    film.save_strip(CAR, task, rollout, tmp_path / "soon.png", size=(360, 90), count=3)
    with Image.open(tmp_path / "soon.png") as soon:
        assert soon.size == (360, 90)
    assert film.landing_of(CAR, replace(rollout, score=0.0)) is None
    touched = replace(rollout, events=(RolloutEvent(0.4, "landing"),))
    assert film.landing_of(CAR, touched) == landing  # what is measured at the end is earned there
    film.save_strip(CAR, task, rollout, tmp_path / "x.png", size=(240, 180), count=4)
    with Image.open(tmp_path / "x.png") as square:
        assert square.size == (240, 180)  # two rows of two
    film.save_strip(CAR, task, rollout, tmp_path / "x.png", count=5)
    with Image.open(tmp_path / "x.png") as row:
        assert row.size == (5 * 480, 360 + film.KEY)
        key = np.asarray(row.crop((0, 360, 5 * 480, 360 + film.KEY)))
    hurt = Broken(block=1, type=1, partner=0, time=0.0, load=1.1)
    film.save_strip(CAR, task, replace(rollout, broken=(hurt,)), tmp_path / "x.png", count=5)
    with Image.open(tmp_path / "x.png") as row:
        red = np.asarray(row.crop((0, 360, 5 * 480, 360 + film.KEY)))
    counts = [int((part == film.TRAIL).all(axis=2).sum()) for part in (key, red)]
    assert 0 < counts[0] < counts[1] - 100  # a red block is explained where there is one


def test_distance_marks_count_from_where_the_score_is_0() -> None:
    rollout = drive()[1]
    landing = film.landing_of(CAR, rollout)
    assert landing is not None
    assert rollout.trace is not None
    assert landing.start is not None
    assert landing.place[2] - landing.start == pytest.approx(rollout.score)
    moved = replace(rollout.trace, centre=rollout.trace.centre + np.array([0.0, 0.0, 7.0]))
    shifted = film.landing_of(CAR, replace(rollout, trace=moved))
    assert shifted is not None
    assert shifted.start == pytest.approx(landing.start + 7.0)


def test_a_throw_counts_from_where_its_boulder_was_and_all_its_way_is_in_view() -> None:
    """The mark 0 and the flag are as far apart as the score, wherever the machine stands."""
    machine, _, rollout = far_throw()
    assert rollout.trace is not None
    boulder = rollout.trace.centre[:, film.tracked_block(machine)]
    landing = film.landing_of(machine, rollout)
    assert landing is not None
    assert landing.start is None  # its flight was stretched, its score was not
    rollout = replace(rollout, score=landing.place[2] - float(boulder[0, 2]))
    landing = film.landing_of(machine, rollout)
    assert landing is not None
    assert landing.start is not None
    assert abs(landing.start) > 1.0
    assert landing.start == pytest.approx(boulder[0, 2])
    assert landing.place[2] - landing.start == pytest.approx(rollout.score)
    assert rollout.trace is not None
    trace = rollout.trace.even
    last = int(np.searchsorted(trace.times, landing.time))
    view = View(back=SIDE, size=(320, 240))
    cameras = film._cameras(trace, film.tracked_block(machine), view, landing)
    for index, camera in enumerate(cameras):
        flown = trace.centre[: min(index + 1, last), film.tracked_block(machine)]
        places = project(flown, camera)
        assert (places > 0).all()
        assert (places < (320, 240)).all()


def test_one_frame_alone_makes_an_mp4_too(tmp_path: Path) -> None:
    save_mp4([Image.new("RGB", (64, 48))], tmp_path / "x.mp4", 0.5)
    boxes = boxes_of((tmp_path / "x.mp4").read_bytes())
    assert int.from_bytes(boxes["stsz"][8:12], "big") == 2


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
@pytest.mark.slow
def test_a_film_has_the_same_bytes_every_time(ending: str, tmp_path: Path) -> None:
    task, rollout = drive()
    paths = [(tmp_path / name).with_suffix(ending) for name in ("a", "b")]
    for path in paths:
        save_film(CAR, task, rollout, path, size=SIZE)
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.slow
def test_a_block_is_red_from_the_moment_it_breaks() -> None:
    rollout = drive()[1]
    broken = Broken(block=1, type=1, partner=0, time=0.5, load=1.1)
    hurt = np.array(reds(replace(rollout, broken=(broken,))))
    more = hurt - reds(rollout)
    assert more[:3].tolist() == [0, 0, 0]
    assert (more[3:] > 80).all()


@pytest.mark.slow
def test_the_path_grows_with_every_sample() -> None:
    counts = reds(drive()[1])
    assert counts[0] == 0
    assert counts == sorted(set(counts))


def test_walls_before_the_machine_are_as_glass_and_its_ground_is_not() -> None:
    """A turned wall hides nothing of the machine; a slab on which it stands keeps its colour."""
    task, rollout = drive()
    assert rollout.scene is not None
    assert rollout.trace is not None
    wall = SceneObject("wall", "box", (1.0, 6.0, 9.0), (5.0, 3.0, -2.0), (0.0, 0.2, 0.0, 0.98))
    slab = SceneObject("slab", "box", (60.0, 3.0, 60.0), (0.0, -1.4, 0.0), color=(0.1, 0.2, 0.9, 1))
    pictures = []
    for objects in ((), (wall,), (slab,)):
        changed = replace(rollout, scene=replace(rollout.scene, objects=objects))
        pictures.append(np.asarray(frames_of(CAR, task, changed, (160, 120))[0]).astype(int))
    alone, behind, above = pictures
    machine = np.abs(alone - SCREEN.land).max(axis=2) > 100
    assert np.abs(behind - alone)[machine].max(axis=1).mean() < 12
    assert (np.abs(behind - alone).max(axis=2) > 8).sum() > 500  # the glass is seen
    assert (above[:, :, 2] > above[:, :, 0] + 100).mean() > 0.4


def test_the_last_frame_is_held_and_the_card_has_the_score_of_any_task(tmp_path: Path) -> None:
    """A score is earned at the end: also one that is no distance has its card there."""
    task, rollout = drive()
    for each in (rollout, replace(rollout, terms={})):
        film.save_film(CAR, task, each, tmp_path / "x.gif", size=(320, 240))
        with Image.open(tmp_path / "x.gif") as picture:
            assert film_ends(picture) == (200, 200 + 1000 * film.HELD)
            card = np.asarray(picture.convert("RGB"))[200:, 160:]
            assert (card > 250).all(axis=2).mean() > 0.1


def test_distances_have_equal_steps_and_none_is_over_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From a machine up to 200 m, as at the end of a far throw."""
    written = list[tuple[float, str]]()

    def write(_: ImageDraw.ImageDraw, place: Any, words: str, *__: Any, **___: Any) -> None:
        written.append((place[0], words))

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", write)
    points = np.array([(x, 0.0, z) for x in (-5.0, 5.0) for z in (0.0, 200.0)])
    view = View(back=SIDE, size=(960, 720))
    camera = camera_at(*fit(points, view), view)
    ground = Image.new("RGB", view.size)
    backdrop.mark_distances(ground, ground, camera, backdrop.Course(), SCREEN)
    marks = [float(words.removesuffix(" m")) for _, words in written]
    assert marks[:4] == [0.0, marks[1], 2 * marks[1], 3 * marks[1]]
    assert all(after[0] - before[0] > 60 for before, after in pairwise(written))


def film_ends(picture: Image.Image) -> tuple[float, float]:
    """How long the first and the last frame of a GIF are shown, ms; the last one is then loaded."""
    first = picture.info["duration"]
    picture.seek(getattr(picture, "n_frames", 1) - 1)
    return first, picture.info["duration"]


def test_the_camera_sees_a_flag_far_from_the_machine_at_the_end() -> None:
    rollout = drive()[1]
    assert rollout.trace is not None
    far = film.Landing(1.0, (3.0, 1.0, 250.0), "250.00 m", 0.0)
    view = View(back=SIDE, size=(320, 240))
    camera = film._cameras(rollout.trace, 0, view, far)[-1]
    places = project(np.array([rollout.trace.centre[0, 0], far.place]), camera)
    assert (places > 0).all()
    assert (places < (320, 240)).all()


def test_the_camera_follows_smoothly() -> None:
    _, rollout = drive()
    assert rollout.trace is not None
    cameras = film._cameras(rollout.trace, 0, View(back=SIDE, size=SIZE))
    targets = np.array([camera.target for camera in cameras])
    moves = [float(np.linalg.norm(after - before)) for before, after in pairwise(targets)]
    assert len(cameras) == 6
    assert max(moves) < 1.5
    assert targets[-1, 2] > targets[0, 2]


@pytest.mark.slow
def test_a_far_throw_shows_machine_walls_and_boulder_in_every_frame() -> None:
    machine, task, rollout = far_throw()
    assert rollout.trace is not None
    every = [0, 20, 40, 60, 90, 120, 150]
    frames = frames_of(machine, task, rollout, (320, 240))
    rightmost = []
    for index in every:
        pixels = np.asarray(frames[index]).astype(np.int64)
        red, green, blue = pixels[:, :, 0], pixels[:, :, 1], pixels[:, :, 2]
        assert ((red - green > 20) & (green - blue > 20)).sum() > 60  # wood
        columns = np.flatnonzero(((red > 150) & (green < 90) & (blue < 80)).any(axis=0))
        rightmost.append(int(columns.max()) if len(columns) else 0)
    assert min(rightmost[2:]) > 200, rightmost
