"""The change between the game frame and the engine's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from agentflow.env.physics.frames import (
    swap,
    swap_all,
    swap_quaternion,
    swap_quaternions,
    swap_turn,
    swap_turns,
)
from agentflow.env.rotations import compose, conjugate, cross, matrices, turn, turn_back
from agentflow.machine.geometry.vectors import product, rotate_vector, rotation_from_up

numbers = st.floats(-10, 10)
vectors = st.tuples(numbers, numbers, numbers)
quaternions = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .filter(lambda q: sum(x * x for x in q) > 0.1)
    .map(lambda q: tuple(float(x) for x in np.array(q) / np.linalg.norm(q)))
)


@given(quaternions, vectors)
def test_turning_and_swapping_commute(q: tuple[float, ...], v: tuple[float, ...]) -> None:
    there = rotate_vector(swap_quaternion(q), swap(v))  # type: ignore[arg-type]
    assert swap(rotate_vector(q, v)) == pytest.approx(there, abs=1e-9)  # type: ignore[arg-type]


@given(vectors, vectors)
def test_velocity_of_a_turning_point_swaps(w: tuple[float, ...], r: tuple[float, ...]) -> None:
    there = np.cross(swap_turn(w), swap(r))
    assert swap(np.cross(w, r)) == pytest.approx(there, abs=1e-9)


def test_arrays_swap_as_single_vectors_do() -> None:
    vector, quaternion = (1.0, 2.0, 3.0), (0.1, 0.2, 0.3, 0.9)
    assert swap_all(np.array([vector])).tolist() == [list(swap(vector))]
    assert swap_turns(np.array([vector])).tolist() == [list(swap_turn(vector))]
    assert swap_quaternions(np.array([quaternion])).tolist() == [list(swap_quaternion(quaternion))]


@given(quaternions, quaternions, vectors, vectors)
def test_arrays_agree_with_tuples(
    p: tuple[float, ...], q: tuple[float, ...], v: tuple[float, ...], w: tuple[float, ...]
) -> None:
    a, b, x = np.array([p]), np.array([q]), np.array([v])
    assert turn(matrices(a), x)[0] == pytest.approx(rotate_vector(p, v), abs=1e-9)  # type: ignore[arg-type]
    assert turn_back(matrices(a), turn(matrices(a), x))[0] == pytest.approx(v, abs=1e-9)
    assert compose(a, b)[0] == pytest.approx(product(p, q), abs=1e-12)  # type: ignore[arg-type]
    assert compose(a, conjugate(a))[0] == pytest.approx([0, 0, 0, 1], abs=1e-9)
    assert cross(x, np.array([w]))[0] == pytest.approx(np.cross(v, w), abs=1e-9)


@given(vectors.filter(lambda v: sum(x * x for x in v) > 0.01))
@example((6e-5, -1.0, 0.0))
@example((0.0, -1.0, 1e-12))
def test_upright_to_points_there(v: tuple[float, float, float]) -> None:
    tip = rotate_vector(rotation_from_up(v), (0.0, 1.0, 0.0))
    assert tip == pytest.approx(np.array(v) / np.linalg.norm(v), abs=1e-9)
