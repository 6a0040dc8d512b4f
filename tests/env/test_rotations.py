"""Quaternion arithmetic against the six orientations of spec 1.2."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.env.rotations import compose, conjugate, rotate, rotated_axes, unify_signs

HALF = 0.5**0.5
ORIENTATIONS = [
    ((0, 0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ((0, HALF, 0, HALF), (0, 0, -1), (0, 1, 0), (1, 0, 0)),
    ((0, -HALF, 0, HALF), (0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    ((-HALF, 0, 0, HALF), (1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((HALF, 0, 0, HALF), (1, 0, 0), (0, 0, 1), (0, -1, 0)),
]
UNIT = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: np.array(q) / np.linalg.norm(q))
)


@pytest.mark.parametrize(("quaternion", "right", "up", "front"), ORIENTATIONS)
def test_the_six_orientations(
    quaternion: tuple[float, ...],
    right: tuple[float, ...],
    up: tuple[float, ...],
    front: tuple[float, ...],
) -> None:
    turn = np.array(quaternion, dtype=float)
    for axis, wanted in zip(np.eye(3), (right, up, front), strict=True):
        assert rotate(turn, axis) == pytest.approx(wanted, abs=1e-12)


@given(UNIT, UNIT)
def test_chains_turn_one_after_the_other_and_inverses_back(
    first: np.ndarray, second: np.ndarray
) -> None:
    point = np.array([1.0, -2.0, 3.0])
    both = rotate(compose(second, first), point)
    assert both == pytest.approx(rotate(second, rotate(first, point)), abs=1e-9)
    assert rotate(conjugate(first), rotate(first, point)) == pytest.approx(point, abs=1e-9)


@given(UNIT)
def test_a_frame_holds_the_turned_axes(turn: np.ndarray) -> None:
    x, y, z, w = turn.tolist()
    expected = rotate(np.tile(turn, (3, 1)), np.eye(3))
    assert rotated_axes((x, y, z, w)) == pytest.approx(expected, abs=1e-12)


def test_neighbours_in_time_lie_on_one_side() -> None:
    turn = np.array([0.0, HALF, 0.0, HALF])
    turns = np.array([[turn, turn], [-turn, turn], [turn, -turn]])
    assert unify_signs(turns).tolist() == [[turn.tolist()] * 2] * 3
    assert unify_signs(turns[:, 0]).tolist() == [turn.tolist()] * 3
