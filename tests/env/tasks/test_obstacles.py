"""The solids of the movement levels stand where the level says."""

from __future__ import annotations

from itertools import pairwise
from math import atan2, degrees

import numpy as np
import pytest

from agentflow.env.rotations import rotate
from agentflow.env.scene import SceneObject
from agentflow.env.tasks.features.terrain import PLATE, bump, quarter_pipe
from agentflow.env.tasks.registry import get_task


def test_a_bump_rises_to_its_height_over_its_length() -> None:
    item = bump("bump", 15.0, 1.0, 4.0, 23.0)
    radius, middle = item.size[0] / 2, item.position[1]
    assert (radius, item.size[1]) == (2.5, 23.0)
    assert middle + radius == 1.0
    assert radius**2 - middle**2 == pytest.approx(4.0)
    assert rotate(np.array(item.rotation), (0.0, 1.0, 0.0)) == pytest.approx((-1.0, 0.0, 0.0))


def top_edge(item: SceneObject, end: float) -> tuple[float, float]:
    """z and y of the upper edge at the near (-1) or far (1) end of a plate."""
    corner = rotate(np.array(item.rotation), (0.0, PLATE / 2, end * item.size[2] / 2))
    return item.position[2] + corner[2], item.position[1] + corner[1]


def test_a_quarter_pipe_runs_from_the_ground_to_its_edge_without_a_gap() -> None:
    plates = list(quarter_pipe("ramp", 19.0, 3.5, 6.6, 24.0))
    assert top_edge(plates[0], -1.0) == pytest.approx((15.7, 0.0))
    assert top_edge(plates[-1], 1.0) == pytest.approx((22.3, 3.5))
    for lower, upper in pairwise(plates):
        assert top_edge(lower, 1.0) == pytest.approx(top_edge(upper, -1.0))


def test_the_levels_place_them_by_the_table() -> None:
    bumps = [t for t in get_task("movement/2").scene().objects if t.name.startswith("bump")]
    assert [item.position[2] for item in bumps] == [15.0, 30.0]
    assert (
        "A quarter-pipe lies across the whole road: it starts flat at z = 15.7 m and steepens to "
        "its edge at z = 22.3 m, 3.5 m high. Its profile is an arc of radius 8.0 m in 8 flat "
        "pieces, the last 52 degrees steep. Behind the edge it drops to the ground."
        in get_task("movement/3").brief.scene
    )
    assert get_task("throwing/3").brief.scene[-1] == (
        "From t = 0 on a steady wind blows: 6 m/s towards z- and 3 m/s towards y- (downward)."
    )


def test_the_profile_is_told_as_it_is_built() -> None:
    *_, last = quarter_pipe("ramp", 19.0, 3.5, 6.6, 20.0)
    x, _, _, w = last.rotation
    assert degrees(2 * atan2(abs(x), w)) == pytest.approx(52.0, abs=0.5)
