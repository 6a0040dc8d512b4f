"""Stills: size, contents, every side, and the same bytes each time."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from agentflow.env.drawing.backdrop import PAPER, SCREEN
from agentflow.env.drawing.cameras import VIEWS
from agentflow.env.drawing.solids import BROKEN, ROD_DIAMETER, MachineSolids, Pose
from agentflow.env.drawing.stills import AXES_BAND, FOOT, StillOptions, render_png
from agentflow.env.scene import Start
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UnknownNameError
from agentflow.machine.tree import ROOT, Machine, Step
from tests.env.machines import BALLASTED, machine

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
ARROW = machine((0, -1, -1), (1, 0, 0), (1, 0, 2), (35, 1, 0))
"""Forward a block and a ballast, one block to a side."""


def pixels_of(path: Path) -> NDArray[np.int64]:
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(np.int64)


def test_the_machine_fills_the_picture_and_stands_on_land(tmp_path: Path) -> None:
    render_png(CAR, tmp_path / "car.png", size=(160, 120))
    pixels = pixels_of(tmp_path / "car.png")
    assert pixels.shape == (120, 160, 3)
    solid = np.abs(pixels - SCREEN.land).max(axis=2) > 100
    rows, columns = np.flatnonzero(solid.any(axis=1)), np.flatnonzero(solid.any(axis=0))
    assert rows.min() > 5
    assert rows.max() < 115
    assert columns.min() > 5
    assert columns.max() < 155
    assert max(np.ptp(rows) / 120, np.ptp(columns) / 160) > 0.5
    assert (pixels == SCREEN.land).all(axis=2).mean() > 0.3


def test_all_views_differ_and_a_sheet_shows_them_all(tmp_path: Path) -> None:
    pictures = {}
    for view in VIEWS:
        render_png(BALLASTED, tmp_path / "x.png", view=view, size=(80, 60))
        pictures[view] = pixels_of(tmp_path / "x.png")
    for one, other in combinations(pictures, 2):
        assert np.abs(pictures[one] - pictures[other]).max() > 60, (one, other)
    render_png(BALLASTED, tmp_path / "sheet.png", view="sheet", size=(240, 120))
    sheet = pixels_of(tmp_path / "sheet.png")
    assert sheet.shape == (120, 240, 3)
    foot = sheet[-FOOT + 4 :, :] == SCREEN.land
    assert 0.02 < 1 - foot.all(axis=2).mean() < 0.2  # the measures of the machine


def test_a_sheet_may_be_as_small_as_any_picture(tmp_path: Path) -> None:
    render_png(BALLASTED, tmp_path / "sheet.png", view="sheet", size=(16, 16))
    assert pixels_of(tmp_path / "sheet.png").shape == (16, 16, 3)


def test_nothing_sinks_into_the_ground_in_views_from_the_sides(tmp_path: Path) -> None:
    """From there, there is no perspective, with or without a scale."""
    for scale in (False, True):
        options = StillOptions(SCREEN, scale=scale)
        render_png(ARROW, tmp_path / f"{scale}.png", view="front", size=(160, 120), options=options)
        pixels = pixels_of(tmp_path / f"{scale}.png")
        line = np.flatnonzero((pixels[:, 3] != SCREEN.land).any(axis=1))
        machine_rows = np.flatnonzero((pixels[:, 75:85, 2] < 100).any(axis=1))
        assert abs(machine_rows.max() - line.max()) <= 2


def test_each_view_has_the_side_that_it_is_named_after(tmp_path: Path) -> None:
    weights = {}
    for view in VIEWS:
        render_png(ARROW, tmp_path / "x.png", view=view, size=(160, 120))
        pixels = pixels_of(tmp_path / "x.png")
        bluish = (pixels[:, :, 2] > pixels[:, :, 0] + 8) & (pixels.sum(axis=2) < 450)
        weights[view] = np.argwhere(bluish).mean(axis=0) if bluish.any() else None
    assert weights["back"] is None
    assert weights["front"] is not None
    assert weights["left"][1] < 70
    assert weights["right"][1] > 90
    assert weights["top"][0] < 40
    assert weights["three-quarter"][1] > 80


def test_a_picture_has_the_same_bytes_every_time(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        render_png(CAR, tmp_path / name, view="sheet", size=(160, 120))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_an_unknown_view_is_named_with_those_that_exist(tmp_path: Path) -> None:
    with pytest.raises(
        UnknownNameError, match="unknown view 'frnt'; known: front, left, back, right"
    ):
        render_png(CAR, tmp_path / "x.png", view="frnt")


def test_broken_blocks_are_red_and_broken_springs_are_gone() -> None:
    figures = MachineSolids(CAR)
    rest = figures.rest
    whole = {item.name for item in figures.objects(rest)}
    hurt = figures.objects(Pose(rest.centre, rest.rotation, range(7)), {1})
    assert whole == {f"block {i}" for i in range(8)}
    assert {item.name for item in hurt if item.color == BROKEN} == {"block 1"}
    assert "block 7" not in {item.name for item in hurt}


def test_a_spring_spans_the_faces_that_it_hangs_on() -> None:
    figures = MachineSolids(CAR)
    spring = figures.rod(7, figures.rest)
    assert spring.size == pytest.approx((ROD_DIAMETER, 17**0.5, ROD_DIAMETER))
    moved = figures.rest.centre.copy()
    moved[2] += (0.0, 0.0, -3.0)
    assert figures.rod(7, Pose(moved, figures.rest.rotation, range(8))).size[1] == pytest.approx(
        50**0.5
    )


def test_from_its_sides_and_from_above_a_machine_has_neither_grid_nor_shadow(
    tmp_path: Path,
) -> None:
    found = {}
    for view in VIEWS:
        options = StillOptions(PAPER, scale=view != "three-quarter")
        render_png(ARROW, tmp_path / "x.png", view=view, size=(160, 120), options=options)
        pixels = pixels_of(tmp_path / "x.png")[:80]  # above the scale
        grey = (np.ptp(pixels, axis=2) == 0) & (pixels[:, :, 0] > 150) & (pixels[:, :, 0] < 250)
        found[view] = np.flatnonzero(grey.any(axis=1)).size
    assert found.pop("three-quarter") > 30
    assert found.pop("top") == 0
    assert max(found.values()) <= 3  # the line of the ground


def alpha(path: Path) -> NDArray[np.uint8]:
    return np.asarray(Image.open(path).convert("RGBA"))[:, :, 3]


def test_nothing_is_behind_a_machine_on_no_ground_and_white_on_paper(tmp_path: Path) -> None:
    path = tmp_path / "x.png"
    render_png(CAR, path, size=(160, 120), options=StillOptions(None, axes=True))
    assert alpha(path)[0, 0] == 0
    assert 0.1 < (alpha(path) > 0).mean() < 0.5
    render_png(CAR, path, size=(160, 120), options=StillOptions(PAPER))
    with Image.open(path) as picture:
        assert picture.getpixel((1, 118)) == (255, 255, 255)


def test_all_views_of_a_sheet_to_scale_have_one_scale(tmp_path: Path) -> None:
    path = tmp_path / "x.png"
    render_png(ARROW, path, view="sheet", size=(960, 640), options=StillOptions(None, scale=True))
    tiles = [alpha(path)[2:296, 144 + 320 * i : 176 + 320 * i] > 0 for i in range(3)]
    rows = [int(np.flatnonzero(tile[22:].any(axis=1)).size) for tile in tiles]
    assert max(rows) - min(rows) <= 1  # as high from the front, from the back and from the left
    foot = alpha(path)[-FOOT + 4 :] > 0
    assert foot[:, :200].any()  # measures
    assert foot[:, 900].any()  # one scale


def test_every_side_is_equally_bright_and_clear_of_axes_and_scale(tmp_path: Path) -> None:
    """A block of one colour, from five sides; below it is what says where and how large it is."""
    block, brights = Machine((ROOT,)), []
    for view in ("front", "back", "left", "right", "top"):
        options = StillOptions(None, axes=True, scale=True)
        render_png(block, tmp_path / "x.png", view=view, size=(400, 400), options=options)
        seen = alpha(tmp_path / "x.png") > 0
        assert seen[40:260, 200].all(), view
        assert not seen[400 - AXES_BAND - 12 : 400 - AXES_BAND].any(), view
        brights.append(pixels_of(tmp_path / "x.png")[150, 200].sum())
    assert max(brights) - min(brights) <= 3


def test_a_level_is_drawn_around_the_machine_where_it_starts(tmp_path: Path) -> None:
    scene = get_task("throwing", {}).scene()
    figures = MachineSolids(CAR)
    raised = figures.rest.at_start(Start(height=3.0))
    assert np.allclose(raised.centre - figures.rest.centre, (0.0, 3.0, 0.0))
    render_png(CAR, tmp_path / "x.png", size=(160, 120), options=StillOptions(None))
    alone = (alpha(tmp_path / "x.png") > 0).sum(axis=0)
    render_png(CAR, tmp_path / "x.png", size=(160, 120), options=StillOptions(None, scene=scene))
    within = (alpha(tmp_path / "x.png") > 0).sum(axis=0)
    assert np.count_nonzero(within) > np.count_nonzero(alone)  # walls on both sides
