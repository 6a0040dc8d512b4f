"""Rough ground: seeded, within its limits, and nowhere near the start."""

from __future__ import annotations

import pytest

from agentflow.env.drawing.raster import corners_of
from agentflow.env.tasks.features.terrain import Roughness, Stones
from agentflow.env.tasks.registry import get_task

WIDTH = 23.0


def test_slabs_cover_the_road_and_rise_no_further_than_told() -> None:
    rough = Roughness(height=0.15, first=10, last=40)
    things = list(rough.things(WIDTH, 0))
    assert len(things) == 8 * 10
    tops = [corners_of(thing)[:, 1].max() for thing in things]
    assert 0.05 < max(tops) <= 0.15 + 1e-9
    assert min(corners_of(thing)[:, 1].max() for thing in things) > 0.0
    assert len({round(top, 6) for top in tops}) > 70
    area = sum(thing.size[0] * thing.size[2] for thing in things)
    assert area == pytest.approx(WIDTH * 30)


def test_stones_are_as_many_as_the_density_says_and_half_in_the_ground() -> None:
    stone = Stones(density=0.06, first=10, last=200)
    things = list(stone.things(WIDTH))
    assert len(things) == round(0.06 * WIDTH * 190)
    assert all(0.5 <= thing.size[0] <= 2 for thing in things)
    assert all(thing.position[1] == 0 for thing in things)
    assert all(10 <= thing.position[2] <= 200 for thing in things)
    assert all(abs(thing.position[0]) <= WIDTH / 2 for thing in things)


def test_the_seed_says_where_they_lie() -> None:
    one, same, other = (list(Stones(density=0.06, seed=s).things(WIDTH)) for s in (1, 1, 2))
    assert one == same
    assert one != other


def test_flat_ground_has_none() -> None:
    assert list(Roughness().things(WIDTH, 0)) == []
    assert list(Stones().things(WIDTH)) == []


def test_the_level_tells_its_numbers() -> None:
    text = " ".join(get_task("movement/4").brief.scene)
    assert (
        "From z = 10 m to z = 200 m the ground is uneven: slabs 3 m long and about as wide, "
        in (text)
    )
    assert "rise up to 0.15 m" in text
    assert "0.06 per square metre: fixed balls, 0.5 to 2 m in diameter" in text
