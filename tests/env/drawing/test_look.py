"""Pictures for agents: which way they look, what they are labelled with, which moment they show."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from agentflow.env.drawing.look import AXES, DIRECTIONS, look_at
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine.tree import ROOT, Machine, Step

CAR = Machine(
    (
        ROOT,
        Step(1, 1, 0, 0),
        Step(2, 1, 0, 1),
        Step(3, 2, 1, 1),
        Step(4, 2, 1, 3),
        Step(5, 2, 2, 1),
        Step(6, 2, 2, 3),
    )
)


def pixels(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(content)).convert("RGB"), dtype=int)


def axis_ends(picture: np.ndarray, name: str) -> tuple[int, int]:
    """How far the arrow of an axis reaches to the right and up from its start, in pixels."""
    near = np.abs(picture[380:470, 5:110] - AXES[name]).sum(axis=2) < 12
    rows, columns = np.nonzero(near)
    if not len(rows):
        return 0, 0
    right = columns.max() - 47 if columns.max() - 47 > 47 - columns.min() else columns.min() - 47
    up = 48 - rows.min() if 48 - rows.min() > rows.max() - 48 else 48 - rows.max()
    return int(right), int(up)


@pytest.mark.parametrize(
    ("view", "right", "up"),
    [("front", "-x", "y"), ("side", "z", "y"), ("top", "x", "z")],
)
def test_axes_show_the_direction_of_the_view(view: str, right: str, up: str) -> None:
    picture = pixels(look_at(CAR, view))
    assert picture.shape == (480, 640, 3)
    sideways, _ = axis_ends(picture, right.removeprefix("-"))
    assert sideways < -20 if right.startswith("-") else sideways > 20
    assert axis_ends(picture, up)[1] > 20


@pytest.mark.slow
def test_views_and_moments_differ_and_repeat_exactly() -> None:
    rollout = simulate(CAR, get_task("movement"))
    asked = [(view, None) for view in DIRECTIONS] + [("iso", 0.0), ("iso", 2.0)]
    drawn = [look_at(CAR, view, rollout, time) for view, time in asked]
    assert len(set(drawn)) == len(drawn)
    assert look_at(CAR, "iso", rollout, 2.0) == drawn[-1]
    assert look_at(CAR, "iso", rollout, 2.001) == drawn[-1]  # the nearest recorded state


def test_moments_that_were_not_simulated_are_refused() -> None:
    rollout = simulate(CAR, get_task("movement"))
    with pytest.raises(UsageError, match=r"^there is no picture at 7 s; .* from 0 to 5 s$"):
        look_at(CAR, "iso", rollout, 7.0)
