"""The platform: a plate right under the machine, wherever its angle puts it."""

from __future__ import annotations

from math import radians, sin

import numpy as np
import pytest

from agentflow.env.drawing.raster import corners_of
from agentflow.env.rotations import rotate
from agentflow.env.scene import Start
from agentflow.env.tasks.features.platforms import Platform
from agentflow.env.tasks.registry import get_task


@pytest.mark.parametrize(("height", "angle"), [(2, 0), (0, 15), (1, -20)])
def test_its_upper_side_is_the_plane_that_the_machine_stands_on(
    height: float, angle: float
) -> None:
    platform = Platform(height=height, angle=angle)
    (plate,) = platform.objects()
    start = platform.start
    normal = rotate(np.array(start.rotation), (0.0, 1.0, 0.0))
    above = (corners_of(plate) - (0.0, start.height, 0.0)) @ normal
    assert above.max() == pytest.approx(0.0, abs=1e-9)
    upper = corners_of(plate)[above > -1e-6]
    assert upper[:, 1].min() == pytest.approx(height)
    ends = [upper[np.sign(upper[:, 2]) == side][:, 1].mean() for side in (-1, 1)]
    assert ends[1] - ends[0] == pytest.approx(18 * sin(radians(angle)))


def told(**platform: float) -> list[str]:
    """What a brief says of a platform."""
    knobs = {f"platform.{name}": value for name, value in platform.items()}
    return [line for line in get_task("throwing", knobs).brief.scene if "platform" in line]


def test_without_one_the_machine_stands_on_the_ground() -> None:
    platform = Platform()
    assert (platform.objects(), told(), platform.start) == ((), [], Start())


def test_it_is_told() -> None:
    assert told(height=2) == ["It starts on a platform, 18 m long and wide, 2 m above the ground."]
    assert told(angle=-10) == [
        "It starts on a platform, 18 m long and wide, tilted by 10 "
        "degrees with its z- end up; its lowest edge is 0 m above the ground, and the machine is "
        "tilted with it."
    ]
