"""Rings: their bodies, what passes through them, what that is worth."""

from __future__ import annotations

from math import hypot, inf

import pytest

from agentflow.env.drawing.raster import corners_of
from agentflow.env.tasks.features.rings import SIDES, Ring, RingProgress
from agentflow.machine.geometry.vectors import Vec3

NEAR, FAR = Ring((0.0, 7.0, 14.0), 4.0), Ring((0.0, 7.0, 22.0), 4.0)


def fly(*places: Vec3) -> RingProgress:
    progress = RingProgress((NEAR, FAR))
    for place in places:
        progress.move_to(place)
    return progress


def test_the_body_leaves_the_opening_free() -> None:
    objects = list(NEAR.objects("ring 1"))
    assert len(objects) == SIDES
    for item in objects:
        away = [hypot(x, y - 7.0) for x, y, _ in corners_of(item)]
        assert min(away) >= 4.0 - 1e-9
        assert max(away) < 4.5
        assert item.position[2] == 14.0


def test_both_rings_passed_in_order_score_twenty() -> None:
    progress = fly((0.0, 7.0, 0.0), (0.0, 9.0, 13.0), (0.0, 9.0, 15.0), (0.0, 7.0, 23.0))
    assert (progress.passed, progress.closest, progress.score) == (2, inf, 20.0)


def test_one_long_step_may_pass_both() -> None:
    assert fly((0.0, 7.0, 0.0), (0.0, 7.0, 30.0)).passed == 2


def test_coming_close_to_the_next_ring_counts_half_a_point_less_per_metre() -> None:
    progress = fly((0.0, 7.0, 0.0), (0.0, 7.0, 10.0))
    assert (progress.passed, progress.closest, progress.score) == (0, 4.0, 8.0)
    progress = fly((0.0, 7.0, 0.0), (0.0, 7.0, 16.0), (0.0, 13.0, 22.0))
    assert (progress.passed, progress.closest, progress.score) == (1, 6.0, 17.0)


def test_far_away_nothing_is_earned() -> None:
    assert fly((0.0, 7.0, -10.0)).score == 0.0


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((0.0, 11.1, 13.0), (0.0, 11.1, 15.0)),  # over it
        ((4.1, 7.0, 13.0), (4.1, 7.0, 15.0)),  # beside it
        ((0.0, 7.0, 15.0), (0.0, 7.0, 13.0)),  # backwards
    ],
)
def test_who_misses_has_not_passed(before: Vec3, after: Vec3) -> None:
    assert fly(before, after).passed == 0


def test_the_second_ring_alone_does_not_count() -> None:
    assert fly((0.0, 20.0, 0.0), (0.0, 20.0, 20.0), (0.0, 7.0, 21.0), (0.0, 7.0, 23.0)).passed == 0
