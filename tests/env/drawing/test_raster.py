"""Drawn solids: where they are seen, which is nearest, how they are shaded and outlined."""

from __future__ import annotations

from math import pi, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from agentflow.env.drawing.cameras import Camera, project
from agentflow.env.drawing.raster import OUTLINE, corners_of, draw
from agentflow.env.scene import SceneObject
from agentflow.machine.geometry.vectors import Quat, Vec3

AHEAD = Camera(eye=(0.0, 5.0, -20.0), target=(0.0, 5.0, 0.0), width=200, height=200)
FOCAL = 100 / tan(pi / 8)
BLUE, RED = (0.1, 0.2, 1.0, 1.0), (1.0, 0.1, 0.1, 1.0)
WHITE = (255, 255, 255)
COORDINATE = st.floats(-3.0, 3.0)
EXTENT = st.floats(0.2, 3.0)


def picture(*objects: SceneObject, camera: Camera = AHEAD) -> NDArray[np.int64]:
    ground = Image.new("RGBA", (camera.width, camera.height), WHITE)
    return np.asarray(draw(camera, objects, ground).convert("RGB")).astype(np.int64)


def seen(*objects: SceneObject, camera: Camera = AHEAD) -> NDArray[np.bool_]:
    """Which pixels are not ground; the outline runs along the outside on two sides."""
    pixels = picture(*objects, camera=camera)
    lined = np.array(WHITE) * OUTLINE
    covered: NDArray[np.bool_] = (pixels != WHITE).any(axis=2) & (pixels != lined.astype(int)).any(
        axis=2
    )
    return covered


def solid(shape: str, size: Vec3, at: Vec3 = (0.0, 5.0, 0.0), **more: object) -> SceneObject:
    return SceneObject("it", shape, size, at, **{"color": BLUE, **more})  # type: ignore[arg-type]


def test_a_sphere_is_a_disc() -> None:
    mask = seen(solid("sphere", (4.0, 9.0, 9.0)))
    radius = FOCAL * 2 / sqrt(20**2 - 2**2)
    assert mask.sum() == pytest.approx(pi * radius**2, rel=0.02)
    rows, columns = np.nonzero(mask)
    assert (rows.mean(), columns.mean()) == pytest.approx((99.5, 99.5), abs=0.6)


def test_a_box_is_its_front_side() -> None:
    mask = seen(solid("box", (4.0, 2.0, 2.0)))
    focal = FOCAL / 19
    assert mask.sum() == pytest.approx(4 * 2 * focal**2, rel=0.02)


@pytest.mark.parametrize(("shape", "share"), [("cylinder", 1.0), ("cone", 0.5)])
def test_a_cylinder_is_a_rectangle_and_a_cone_a_triangle(shape: str, share: float) -> None:
    mask = seen(solid(shape, (1.0, 4.0, 1.0)))
    focal = FOCAL / 20
    assert mask.sum() == pytest.approx(share * 4 * 1 * focal**2, rel=0.05)
    top, bottom = mask[50:100].sum(), mask[100:150].sum()
    assert top / bottom == pytest.approx(1.0 if shape == "cylinder" else 1 / 3, rel=0.06)


@pytest.mark.parametrize("shape", ["cylinder", "cone"])
def test_from_below_a_round_solid_is_its_base(shape: str) -> None:
    below = Camera((0.0, 5.0, 0.0), (0.0, 50.0, 1e-4), 200, 200)
    mask = seen(solid(shape, (4.0, 4.0, 4.0), (0.0, 25.0, 0.0)), camera=below)
    assert mask.sum() == pytest.approx(pi * (FOCAL * 2 / 18) ** 2, rel=0.02)


def test_from_above_a_cone_hides_no_more_than_its_base() -> None:
    above = Camera((0.0, 45.0, 0.0), (0.0, 0.0, 1e-4), 200, 200)
    mask = seen(solid("cone", (4.0, 4.0, 4.0), (0.0, 25.0, 0.0)), camera=above)
    assert mask.sum() == pytest.approx(pi * (FOCAL * 2 / 22) ** 2, rel=0.02)


@given(
    st.sampled_from(["box", "sphere", "cylinder", "cone"]),
    st.tuples(EXTENT, EXTENT, EXTENT),
    st.tuples(COORDINATE, COORDINATE, COORDINATE),
    st.tuples(COORDINATE, COORDINATE, COORDINATE, st.floats(0.5, 3.0)),
)
def test_nothing_is_drawn_outside_of_the_box_around_a_solid(
    shape: str, size: Vec3, at: Vec3, turn: Quat
) -> None:
    length = sqrt(sum(part * part for part in turn))
    rotation = tuple(part / length for part in turn)
    place = (at[0], at[1] + 5.0, at[2])
    mask = seen(solid(shape, size, place, rotation=rotation))
    places = project(corners_of(solid(shape, size, place, rotation=rotation)), AHEAD)
    rows, columns = np.nonzero(mask)
    low, high = places.min(axis=0) - 1, places.max(axis=0) + 1
    assert mask.any()
    assert (low[0] <= columns.min()) & (columns.max() <= high[0])
    assert (low[1] <= rows.min()) & (rows.max() <= high[1])


def test_the_nearest_solid_hides_the_others_in_any_order() -> None:
    near = solid("box", (2.0, 2.0, 2.0), (0.0, 5.0, -5.0))
    far = solid("box", (8.0, 8.0, 2.0), (0.0, 5.0, 5.0), color=RED)
    first, second = picture(near, far), picture(far, near)
    assert (first == second).all()
    assert first[100, 100].argmax() == 2
    assert first[100, 70].argmax() == 0


def test_what_is_below_the_ground_is_hidden() -> None:
    sunk = solid("sphere", (4.0, 4.0, 4.0), (0.0, 0.0, 0.0))
    floating = solid("sphere", (4.0, 4.0, 4.0), (0.0, 2.1, 0.0))
    assert 0.4 < seen(sunk).sum() / seen(floating).sum() < 0.8


def test_sides_that_face_the_light_are_brighter() -> None:
    eye = (14.0, 14.0, -14.0)
    cube = solid("box", (6.0, 6.0, 6.0), (0.0, 4.0, 0.0))
    pixels = picture(cube, camera=Camera(eye, (0.0, 4.0, 0.0), 200, 200))
    top, back, right = pixels[70, 100, 2], pixels[120, 70, 2], pixels[120, 130, 2]
    assert top > back > right > 100


def test_blocks_are_outlined_their_own_pieces_are_not() -> None:
    left = SceneObject("a", "box", (2.0, 2.0, 2.0), (-1.0, 5.0, 0.0), color=BLUE)
    right = SceneObject("a", "box", (2.0, 2.0, 2.0), (1.0, 5.0, 0.0), color=BLUE)
    other = SceneObject("b", "box", (2.0, 2.0, 2.0), (1.0, 5.0, 0.0), color=BLUE)
    assert len(np.unique(picture(left, right)[100, 95:106], axis=0)) == 1
    assert len(np.unique(picture(left, other)[100, 95:106], axis=0)) == 2


def test_an_eye_that_is_inside_a_solid_looks_through_it() -> None:
    around = solid("box", (50.0, 50.0, 50.0))
    assert not seen(around).any()


@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
def test_what_a_narrow_view_shows_from_far_away_is_whole(shape: str) -> None:
    far = Camera((0.0, 5.0, -4000.0), (0.0, 5.0, 0.0), 200, 200, 0.06)
    lying = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))
    found = seen(SceneObject("it", shape, (2.0, 2.0, 2.0), (0.0, 5.0, 0.0), lying), camera=far)
    radius = far.focal_length / 4000.0
    assert np.count_nonzero(found) == pytest.approx(pi * radius**2, rel=0.05)
    for row in found[found.any(axis=1)]:
        assert np.count_nonzero(np.diff(row.astype(int))) == 2, "without holes"
