"""Pictures for agents: which way they look, what they are labelled with, which moment they show."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from agentflow.env.drawing.backdrop import SCREEN
from agentflow.env.drawing.look import DIRECTIONS, look_at
from agentflow.env.drawing.stills import AXES, INK
from agentflow.env.feedback.separation import joined_to
from agentflow.env.simulation.simulate import simulate
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine.tree import ROOT, Machine, Step
from benchmarks.shelf import load

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
    asked = [(view, ()) for view in DIRECTIONS] + [("iso", (0.0,)), ("iso", (2.0,))]
    drawn = [look_at(CAR, view, rollout, times) for view, times in asked]
    assert len(set(drawn)) == len(drawn)
    assert look_at(CAR, "iso", rollout, (2.0,)) == drawn[-1]
    assert look_at(CAR, "iso", rollout, (2.001,)) == drawn[-1]  # the nearest recorded state


def test_moments_that_were_not_simulated_are_refused() -> None:
    rollout = simulate(CAR, get_task("movement"))
    with pytest.raises(UsageError, match=r"^there is no picture at 7 s; .* from 0 to 5 s$"):
        look_at(CAR, "iso", rollout, (7.0,))
    with pytest.raises(UsageError, match=r"^there is no block 7; follow one from 0 to 6$"):
        look_at(CAR, "iso", rollout, (1.0,), follow=7)
    with pytest.raises(UsageError, match=r"^no moving object is called 'wall' \(none is there\); "):
        look_at(CAR, "iso", rollout, (1.0,), follow="wall")


HIDDEN = (
    ("throwing/2", "throwing/two_tower_sling.json", "side"),
    ("movement/3", "movement/climbing_car.json", "side"),
    ("picking/3", "picking/crane_with_five_grabbers.json", "front"),
)
"""Levels whose scenery is between the eye and the machine."""


@pytest.mark.slow
@pytest.mark.parametrize(("level", "name", "view"), HIDDEN)
def test_scenery_does_not_hide_the_machine(level: str, name: str, view: str) -> None:
    """What is seen of a machine without scenery is seen with it, but for edges."""
    machine = load(name)
    rollout = simulate(machine, get_task(level))
    assert rollout.scene is not None
    bare = replace(rollout, scene=replace(rollout.scene, objects=rollout.scene.moving))
    with_scenery, alone = (pixels(look_at(machine, view, each, (1.0,))) for each in (rollout, bare))
    machine_colours = (
        np.abs(alone - np.array(SCREEN.land)).sum(axis=2) > 240
    )  # neither ground nor shadow
    kept = np.abs(with_scenery - alone).sum(axis=2)[machine_colours] < 60
    assert machine_colours.sum() > 5000
    assert kept.mean() > 0.95


def test_several_moments_are_one_picture_at_equal_scale() -> None:
    rollout = simulate(CAR, get_task("movement"))
    whole = pixels(look_at(CAR, "side", rollout, (0.0, 1.0, 2.0, 3.0)))
    assert whole.shape == (720, 960, 3)
    bars = [
        (np.abs(whole[top + 335 : top + 345, left + 200 : left + 470] - INK).sum(axis=2) < 30)
        .any(axis=0)
        .sum()
        for top in (0, 360)
        for left in (0, 480)
    ]
    assert len(set(bars)) == 1
    assert bars[0] > 20


def test_the_camera_follows_a_fragment_and_a_moving_object() -> None:
    """What it follows fills more of the frame than in the picture of everything near the root."""
    machine = load("delivery/paddle_car.json")
    rollout = simulate(machine, get_task("delivery", {"window": 2}))
    assert rollout.trace is not None
    wide, cargo, close = (
        look_at(machine, "side", rollout, (2.0,), follow, within)
        for follow, within in ((None, 12.0), ("cargo", 1.0), (3, 1.0))
    )
    assert len({wide, cargo, close}) == 3
    holding = {(1, 0), (2, 1), (5, 4), (4, 3)}
    assert joined_to(0, holding) == {0, 1, 2}
    assert joined_to(5, holding) == {3, 4, 5}
    assert joined_to(9, holding) == {9}
