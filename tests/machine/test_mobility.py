"""Joints that others hold, in pairs and in loops, and joints that only seem to be held."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from agentflow.machine.geometry.mobility import Sets, lock
from agentflow.machine.geometry.vectors import Vec3

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Link:
    """A joint between two bodies."""

    a: int
    b: int
    pivot: Vec3
    axis: Vec3 = Z
    kind: str = "revolute"


def ring(*pivots: Vec3, axis: Vec3 = Z) -> list[Link]:
    """Hinges around a ring of as many bodies."""
    return [Link(i, (i + 1) % len(pivots), pivot, axis) for i, pivot in enumerate(pivots)]


def held(joints: list[Link]) -> set[int]:
    """The joints within one cluster once those that jam are united."""
    sets = Sets()
    lock(joints, range(len(joints)), sets)
    return {i for i, joint in enumerate(joints) if sets.find(joint.a) == sets.find(joint.b)}


TRIANGLE = ring((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (1.0, 2.0, 5.0))
FOUR_BARS = ring((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 2.0, 4.0), (0.0, 1.0, 0.0))
FIVE_BARS = ring(
    (0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 2.0, 4.0), (1.0, 3.0, 0.0), (0.0, 1.0, 0.0)
)
FLAT_TRIANGLE = ring((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (3.0, 0.0, 0.0))
FLAT_PARALLELOGRAM = ring((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (5.0, 0.0, 0.0), (3.0, 0.0, 0.0))
TWISTED = [*ring((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 2.0, 0.0)), Link(3, 0, (0.0, 2.0, 0.0), X)]
TWISTED[2] = Link(2, 3, (3.0, 2.0, 0.0))
DEAD_CENTRE = [
    *ring((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (4.0, 0.0, 0.0))[:2],
    Link(2, 3, (4.0, 0.0, 0.0)),
    Link(3, 0, (4.0, 0.0, 0.0), X, "prismatic"),
]
TRUSS = [
    Link(a, b, pivot, kind="spherical")
    for (a, b), pivot in {
        (0, 1): (0.0, 0.0, 0.0),
        (0, 2): (2.0, 0.0, 0.0),
        (1, 2): (1.0, 2.0, 0.0),
        (1, 3): (0.0, 0.0, 1.0),
        (2, 3): (2.0, 0.0, 1.5),
        (0, 3): (1.0, 1.0, 3.0),
    }.items()
]


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        (TRIANGLE, {0, 1, 2}),
        (FOUR_BARS, set()),
        (FLAT_TRIANGLE, {0, 1, 2}),
        (FLAT_PARALLELOGRAM, set()),
        (TWISTED, {0, 1, 2, 3}),
        (DEAD_CENTRE, set()),
        (TRUSS, {0, 1, 2, 3, 4, 5}),
    ],
    ids=[
        "triangle",
        "four bars",
        "hinges in line, which yield a little at rest",
        "parallelogram laid flat, from which two motions branch off",
        "one axis across",
        "crank at its dead centre, where its slider rests at first",
        "truss of balls",
    ],
)
def test_joints_jam_that_no_finite_motion_uses(joints: list[Link], expected: set[int]) -> None:
    assert held(joints) == expected


def test_a_jammed_loop_in_a_moving_one_jams_alone() -> None:
    """Five bars, of which a sixth makes four."""
    bars = [*FIVE_BARS, Link(0, 5, (1.0, 0.0, 0.0)), Link(5, 1, (2.0, 1.0, 0.0))]
    assert held(FIVE_BARS) == set()
    assert held(bars) == {0, 5, 6}


def test_jammed_loops_may_jam_others() -> None:
    """Two triangles on one bar, whose tips a hinge of their own would let move only together."""
    tips = [
        *TRIANGLE,
        Link(0, 3, (0.0, 0.0, 0.0)),
        Link(3, 2, (1.0, -2.0, 0.0)),
    ]
    assert held(tips) == {0, 1, 2, 3, 4}
