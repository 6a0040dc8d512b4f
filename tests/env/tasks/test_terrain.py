"""Rough ground: seeded, within its limits, and nowhere near the start."""

from __future__ import annotations

import pytest

from agentflow.env.drawing.raster import corners_of
from agentflow.env.tasks.features.terrain import Roughness, Stones
from agentflow.env.tasks.registry import get_task

WIDTH = 23.0


def test_slabs_cover_the_road_and_rise_no_further_than_told() -> None:
    rough = Roughness(height=0.15, first=10, last=40)
    objects = list(rough.objects(WIDTH, 0))
    assert len(objects) == 8 * 10
    tops = [corners_of(item)[:, 1].max() for item in objects]
    assert 0.05 < max(tops) <= 0.15 + 1e-9
    assert min(corners_of(item)[:, 1].max() for item in objects) > 0.0
    assert len({round(top, 6) for top in tops}) > 70
    area = sum(item.size[0] * item.size[2] for item in objects)
    assert area == pytest.approx(WIDTH * 30)


def test_stones_are_as_many_as_the_density_says_and_half_in_the_ground() -> None:
    stone = Stones(density=0.06, first=10, last=200)
    objects = list(stone.objects(WIDTH))
    assert len(objects) == round(0.06 * WIDTH * 190)
    assert all(0.5 <= item.size[0] <= 2 for item in objects)
    assert all(item.position[1] == 0 for item in objects)
    assert all(10 <= item.position[2] <= 200 for item in objects)
    assert all(abs(item.position[0]) <= WIDTH / 2 for item in objects)


def test_the_seed_says_where_they_lie() -> None:
    one, same, other = (list(Stones(density=0.06, seed=s).objects(WIDTH)) for s in (1, 1, 2))
    assert one == same
    assert one != other


def test_flat_ground_has_none() -> None:
    assert list(Roughness().objects(WIDTH, 0)) == []
    assert list(Stones().objects(WIDTH)) == []


def test_the_level_tells_its_numbers() -> None:
    text = " ".join(get_task("movement/4").brief.scene)
    assert (
        "From z = 10 m to z = 200 m the ground is uneven: slabs 3 m long and about as wide, "
        in (text)
    )
    assert "rise up to 0.15 m" in text
    assert "0.06 per square metre: fixed balls, 0.5 to 2 m in diameter" in text
