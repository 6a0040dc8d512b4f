"""Extents of every block type in every facing, computed by hand from the block table."""

from __future__ import annotations

from itertools import product

import pytest

from agentflow.machine import library, place
from tests.loops import for_each
from tests.machine.builders import build

CUBE = ((1, 1, 1), (1, 1, 1), (1, 1, 1))
BEAM = ((2, 1, 1), (1, 2, 1), (1, 1, 2))
WHEEL = ((0.5, 2, 2), (2, 0.5, 2), (2, 2, 0.5))
LARGE = ((1, 3, 3), (3, 1, 3), (3, 3, 1))
COG = ((1, 2, 2), (2, 1, 2), (2, 2, 1))
EXTENT = {
    **dict.fromkeys((4, 5, 13, 14, 15, 19, 22, 27, 28, 35, 44, 76, 86), CUBE),
    **dict.fromkeys((1, 16, 41), BEAM),
    **dict.fromkeys((2, 40), WHEEL),
    **dict.fromkeys((46, 60), LARGE),
    **dict.fromkeys((38, 39), COG),
    26: ((3.2, 0.4, 0.6), (0.6, 3.2, 0.4), (0.6, 0.4, 3.2)),
    30: ((2.8, 3, 2.4), (2.4, 2.8, 3), (2.4, 3, 2.8)),
    36: ((1.9, 1.9, 1.9), (1.9, 1.9, 1.9), (1.9, 1.9, 1.9)),
    47: ((1, 1, 0.5), (0.5, 1, 1), (0.5, 1, 1)),
    49: ((0.5, 0.8, 0.8), (0.8, 0.5, 0.8), (0.8, 0.8, 0.5)),
    50: ((1.5, 1, 0.5), (0.5, 1.5, 1), (0.5, 1, 1.5)),
    51: ((1, 5, 5), (5, 1, 5), (5, 5, 1)),
    55: ((1.8, 0.4, 0.6), (0.6, 1.8, 0.4), (0.6, 0.4, 1.8)),
    56: ((1, 1.7, 1), (1, 1, 1.7), (1, 1.7, 1)),
    63: ((3, 1, 1), (1, 3, 1), (1, 1, 3)),
    87: ((0.2, 0.8, 0.8), (0.8, 0.2, 0.8), (0.8, 0.8, 0.2)),
}
"""Type -> extent along machine x, y, z when it faces x, y, z; the same for + and -."""

ROOT_FACES = {0: (2, 1), 1: (2, -1), 2: (0, -1), 3: (0, 1), 4: (1, 1), 5: (1, -1)}
"""Face of the root -> axis and sign of its normal."""


def test_every_standard_type_is_listed() -> None:
    standard = {kind for kind in library() if kind and library()[kind].size}
    assert standard == set(EXTENT)
    assert set(library()) - standard == {0, 7, 9, 45}


@for_each(product(EXTENT, ROOT_FACES))
def test_the_box_of_a_block_on_the_root(kind: int, face: int) -> None:
    axis, sign = ROOT_FACES[face]
    placed = place(build((kind, 0, face)))[1]
    for other in range(3):
        extent = EXTENT[kind][axis][other]
        low, high = -extent / 2, extent / 2
        if other == axis:
            low, high = sorted((0.5 * sign, (0.5 + extent) * sign))
        assert placed.box_min[other] == pytest.approx(low)
        assert placed.box_max[other] == pytest.approx(high)
