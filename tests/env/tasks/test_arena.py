"""What stands around a thrower."""

from __future__ import annotations

from math import cos, radians, sin

import pytest

from agentflow.env.drawing.raster import corners_of
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from benchmarks.shelf import load


def test_four_ramps_rise_outward_from_the_walls() -> None:
    objects = {item.name: item for item in get_task("throwing/2").scene().objects}
    high, far = 20 * sin(radians(20)), 11.4 + 20 * cos(radians(20))
    for name, axis, sign in (("front", 2, 1), ("back", 2, -1), ("right", 0, 1), ("left", 0, -1)):
        corners = corners_of(objects[f"{name} ramp"])
        upper = corners[corners[:, 1] > corners[:, 1].max() - 1e-6]
        assert upper[:, 1] == pytest.approx(high)
        assert sign * upper[:, axis] == pytest.approx(far)
        foot = corners[abs(corners[:, 1]) < 1e-6]
        assert len(foot) == 2
        assert sign * foot[:, axis] == pytest.approx(11.4)


def test_the_ramps_are_told() -> None:
    assert (
        "Ramps surround the walls on all four sides: they start on the ground 11.4 m from x = z = "
        "0 and rise outward at 20 degrees over 20 m, to a height of 6.8 m; touching one counts as "
        "landing."
    ) in get_task("throwing/2").brief.scene


@pytest.mark.slow
def test_a_throw_that_meets_a_ramp_has_landed_there() -> None:
    """Where the ground is lower it flies on: the ramp costs it a metre."""
    flat, ramps = (
        simulate(load("throwing/spring_arm.json"), get_task(name)).terms
        for name in ("throwing", "throwing/2")
    )
    assert (flat["landed_on"], ramps["landed_on"]) == ("ground", "front ramp")
    assert flat["distance"] == pytest.approx(21.66, rel=0.05)
    assert 0.5 < float(flat["distance"] or 0.0) - float(ramps["distance"] or 0.0) < 2.0


def test_a_hurdle_stands_across_the_way() -> None:
    task = get_task("throwing", {"obstacle.height": 6, "obstacle.at": 14})
    hurdle = task.scene().objects[-1]
    assert (hurdle.name, hurdle.position, hurdle.size) == ("hurdle", (0, 3, 14), (30, 6, 0.8))
    assert task.brief.scene[-1] == (
        "A wall 6 m high, 30 m wide and 0.8 m thick stands across z+ with its middle at z = 14 m."
    )
