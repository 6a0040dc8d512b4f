"""Where machines are put down, and how the wind blows."""

from __future__ import annotations

import numpy as np
import pytest

from agentflow.env.scene import Gust, Scene, Start
from agentflow.machine.geometry.vectors import rotate_vector


def test_a_level_start_turns_nothing() -> None:
    assert Start().rotation == (0.0, 0.0, 0.0, 1.0)


def test_a_pitch_raises_the_front() -> None:
    x, y, z = rotate_vector(Start(pitch=30).rotation, (0.0, 0.0, 1.0))
    assert (x, y, z) == pytest.approx((0.0, 0.5, 3**0.5 / 2))


def test_a_yaw_turns_the_front_to_the_right_on_the_plane() -> None:
    assert rotate_vector(Start(yaw=90).rotation, (0.0, 0.0, 1.0)) == pytest.approx((1.0, 0.0, 0.0))
    front = rotate_vector(Start(pitch=30, yaw=90).rotation, (0.0, 0.0, 1.0))
    side = rotate_vector(Start(pitch=30, yaw=90).rotation, (1.0, 0.0, 0.0))
    assert front == pytest.approx((1.0, 0.0, 0.0))
    assert side == pytest.approx((0.0, -0.5, -(3**0.5) / 2))


def test_without_gusts_the_wind_is_steady() -> None:
    assert {Scene(wind=(1.0, 0.0, 0.0)).strength(time) for time in (0.0, 0.3, 7.0)} == {1.0}


def test_gusts_are_waves_about_the_mean() -> None:
    scene = Scene(gusts=(Gust(0.5, 2.0, 0.0), Gust(0.25, 4.0, np.pi / 2)))
    assert scene.strength(0.0) == pytest.approx(1.25)
    assert scene.strength(0.5) == pytest.approx(1.5 + 0.25 * np.cos(np.pi / 4))
    assert scene.strength(2.0) == pytest.approx(0.75)
