"""Mirror images: what they are, where a machine and its image count as the same."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from agentflow.env.scene import Scene, SceneObject, Start
from agentflow.env.tasks.families.movement import Movement
from agentflow.env.tasks.registry import get_level, get_task, make_task
from agentflow.machine.blocks.library import library
from agentflow.machine.formats.parse import read_machine
from agentflow.machine.geometry.placement import place
from agentflow.machine.geometry.vectors import about_axis
from agentflow.machine.tree import Control, Machine, Step
from agentflow.machine.twins import likeness, mirrored, tree_key

MACHINES = sorted((Path(__file__).parents[1] / "machines").glob("*/*.json"))
ROOT = Step(0, 0, -1, -1)
LEFT, RIGHT = (Machine((ROOT, Step(1, 63, 0, face), Step(2, 15, 1, 0))) for face in (2, 3))
SYMMETRIC = get_task("throwing").brief


def test_an_image_stands_on_the_other_side() -> None:
    """Of every reference machine; the image of an image is the machine."""
    compared = 0
    for path in MACHINES:
        machine = read_machine(json.loads(path.read_text("utf-8")), tuple(library())).machine
        image = machine and mirrored(machine)
        if machine is None or image is None:
            continue
        for here, there in zip(place(machine).blocks, place(image).blocks, strict=True):
            assert here.type == there.type
            assert (here.lo[0], here.hi[0]) == (-there.hi[0], -there.lo[0])
            assert (here.lo[1:], here.hi[1:]) == (there.lo[1:], there.hi[1:])
        assert mirrored(image) == machine
        compared += 1
    assert compared > 20


def test_images_count_as_the_same_where_nothing_tells_them_apart() -> None:
    assert SYMMETRIC.symmetric
    assert mirrored(LEFT) is not None
    assert likeness(LEFT, SYMMETRIC) == likeness(RIGHT, SYMMETRIC)
    assert tree_key(LEFT) != tree_key(RIGHT)
    uneven = replace(SYMMETRIC, symmetric=False)
    assert likeness(LEFT, uneven) != likeness(RIGHT, uneven)


@pytest.mark.parametrize("kind", [22, 28])
def test_motors_turn_the_same_way_in_the_image(kind: int) -> None:
    left, right = (
        replace(machine, steps=(*machine.steps, Step(3, kind, 2, 0))) for machine in (LEFT, RIGHT)
    )
    assert likeness(left, SYMMETRIC) != likeness(right, SYMMETRIC)


def test_machines_with_controls_are_no_images() -> None:
    steered = [replace(m, controls=(Control("motors", 0.0, 1.0, 1.0),)) for m in (LEFT, RIGHT)]
    assert likeness(steered[0], SYMMETRIC) != likeness(steered[1], SYMMETRIC)


def test_scenes_that_tell_left_from_right() -> None:
    box = SceneObject("box", "box", (1.0, 1.0, 2.0), (3.0, 0.5, 1.0), about_axis((0, 1, 0), 0.3))
    other = replace(box, name="b", position=(-3.0, 0.5, 1.0), rotation=about_axis((0, 1, 0), -0.3))
    assert Scene().symmetric
    assert Scene((box, other)).symmetric
    assert not Scene((box,)).symmetric
    assert not Scene((box, replace(other, rotation=box.rotation))).symmetric
    assert not Scene((box, replace(other, friction=0.1))).symmetric
    assert not Scene(wind=(1.0, 0.0, 0.0)).symmetric
    assert Scene(wind=(0.0, 0.0, 1.0)).symmetric
    assert not Scene(start=Start(yaw=5.0)).symmetric


def test_levels_that_tell_left_from_right() -> None:
    for name in ("throwing/1", "throwing/2", "movement/1"):
        assert get_task(name).brief.symmetric
    assert not get_task("delivery").brief.symmetric


def test_briefs_of_a_task_compare_its_scene_with_its_image_once() -> None:
    """A level with stones has hundreds of objects, and every candidate's checks read the brief."""
    seen = []

    class Watched(Movement):
        def scene(self, machine: Machine | None = None) -> Scene:
            seen.append(machine)
            return super().scene(machine)

    task = Watched(**vars(make_task(get_level("movement"))))
    assert task.brief.symmetric
    assert task.brief.symmetric
    assert len(seen) == 1
