"""Pictures: size, contents, and that a film has a frame per sample."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from agentflow.env.backdrop import LAND
from agentflow.env.figures import BROKEN, Figures, Pose
from agentflow.env.render import render_gif, render_png
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine.tree import ROOT, Machine, Step

CAR = Machine(
    (
        ROOT,
        Step(1, 1, 0, 0),
        Step(2, 1, 0, 1),
        Step(3, 2, 1, 2),
        Step(4, 2, 1, 3),
        Step(5, 2, 2, 2),
        Step(6, 2, 2, 3),
        Step(7, 9, 1, 4, 2, 4),
    )
)


def test_the_machine_fills_the_picture_and_stands_on_land(tmp_path: Path) -> None:
    render_png(CAR, tmp_path / "car.png", size=(160, 120))
    with Image.open(tmp_path / "car.png") as picture:
        assert picture.size == (160, 120)
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    solid = np.abs(pixels - LAND).max(axis=2) > 100
    rows, columns = np.flatnonzero(solid.any(axis=1)), np.flatnonzero(solid.any(axis=0))
    assert rows.min() > 5
    assert rows.max() < 115
    assert columns.min() > 5
    assert columns.max() < 155
    assert max(np.ptp(rows) / 120, np.ptp(columns) / 160) > 0.5
    assert (pixels == LAND).all(axis=2).mean() > 0.3


def test_a_film_has_one_frame_per_sample(tmp_path: Path) -> None:
    path = tmp_path / "car.gif"
    task = get_task("movement", {"window": 1})
    rollout = render_gif(CAR, task, path, fps=5, size=(120, 90))
    with Image.open(path) as film:
        assert (film.size, getattr(film, "n_frames", 1)) == ((120, 90), 6)
        assert film.info["duration"] == 200
    assert rollout.score is not None
    assert rollout.score > 3.0


def test_an_invalid_machine_is_not_filmed(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nothing to film, the rollout ended as invalid: "):
        render_gif(CAR, get_task("throwing"), tmp_path / "x.gif")
    assert not (tmp_path / "x.gif").exists()


def test_broken_blocks_are_red_and_broken_springs_are_gone() -> None:
    figures = Figures(CAR)
    rest = figures.rest
    whole = {thing.name: thing for thing in figures.things(rest)}
    hurt = figures.things(Pose(rest.centre, rest.rotation, range(7)), {1})
    assert {name.split(".")[0] for name in whole} == {f"block {i}" for i in range(8)}
    assert {thing.name for thing in hurt if thing.color == BROKEN} == {"block 1.0"}
    assert not any(thing.name.startswith("block 7") for thing in hurt)


def test_a_spring_spans_the_faces_that_it_hangs_on() -> None:
    figures = Figures(CAR)
    (spring,) = [t for t in figures.things(figures.rest) if t.name.startswith("block 7")]
    ends = figures._ends[7]
    assert spring.size[1] == pytest.approx(float(np.linalg.norm(ends[1] - ends[0])))
    assert spring.position == pytest.approx(tuple((ends[0] + ends[1]) / 2))
