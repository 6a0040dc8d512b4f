"""Cameras: everything in the picture, points where they belong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.drawing.cameras import Camera, View, axes_of, camera_at, fit, project

COORDINATE = st.floats(-40.0, 40.0)
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=12)


@given(POINTS, st.tuples(st.floats(0.2, 1.0), st.floats(0.1, 1.0), st.floats(-1.0, 1.0)))
def test_all_points_are_in_the_picture(
    points: list[tuple[float, float, float]], back: tuple[float, float, float]
) -> None:
    view = View(back=back, size=(400, 300))
    array = np.array(points)
    places = project(array, camera_at(*fit(array, view), view))
    assert np.isfinite(places).all()
    assert (places >= -0.5).all()
    assert (places <= np.array([400.5, 300.5])).all()


def test_a_camera_behind_the_machine_sees_right_as_right_and_up_as_up() -> None:
    camera = Camera(eye=(0.0, 0.0, -10.0), target=(0.0, 0.0, 0.0), width=200, height=100)
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -20.0]])
    middle, right, up, behind = project(points, camera)
    assert middle.tolist() == [100.0, 50.0]
    assert right.tolist() == [pytest.approx(112.07, abs=0.01), 50.0]
    assert up.tolist() == [100.0, pytest.approx(37.93, abs=0.01)]
    assert np.isnan(behind).all()


def test_axes_are_a_left_handed_frame() -> None:
    right, up, towards = axes_of(np.array([0.0, 0.0, -3.0]))
    assert (right.tolist(), up.tolist(), towards.tolist()) == (
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, -1.0],
    )
