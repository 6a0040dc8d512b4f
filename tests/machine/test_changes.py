"""Changes of several blocks: what is legal and why not, copies and mirror images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml

from agentflow.app.machines.files import read_one
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, check, place
from agentflow.machine.edits import changes
from agentflow.machine.edits.changes import Mending
from agentflow.machine.edits.draft import End
from agentflow.machine.tree import Control, carried_by
from tests.machine.builders import CAR, build

BRIEF: Brief = get_task("movement").brief
BLOCK, WHEEL, SPRING, LOG = 1, 2, 9, 63


def make(machine: Machine, change: Callable[..., int], *given: Any) -> tuple[Machine, int]:
    return Mending(machine, BRIEF).make(lambda draft: change(draft, *given))


def add(machine: Machine, kind: int, *ends: End) -> Machine:
    return make(machine, changes.add, kind, ends)[0]


def why_not(machine: Machine, change: Callable[..., int], *given: Any) -> str:
    with pytest.raises(UsageError) as refused:
        make(machine, change, *given)
    return str(refused.value)


def test_a_car_is_built_block_by_block() -> None:
    machine = BRIEF.given
    for kind, *end in ((1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3)):
        machine = add(machine, kind, (end[0], end[1]))
    assert machine == CAR


def test_changes_keep_the_control_program() -> None:
    program = (Control((3, 4), 0, 1, 0.5), Control((6,), 1, 1, 1))
    changed, _ = make(replace(CAR, controls=program), changes.remove, 4)
    assert changed.controls == (Control((3,), 0, 1, 0.5), Control((5,), 1, 1, 1))


def test_the_reason_names_the_blocks_that_would_overlap() -> None:
    machine = add(add(BRIEF.given, BLOCK, (0, 0)), WHEEL, (1, 1))
    reason = why_not(machine, changes.add, WHEEL, [(1, 2)])
    assert reason == (
        "block 3 (Powered Wheel) and block 2 (Powered Wheel) overlap by 0.5 x 2.0 x 1.0 m"
    )


def test_removing_takes_all_that_is_attached_and_two_ended_blocks() -> None:
    machine = add(CAR, SPRING, (1, 5), (2, 5))
    left, chosen = make(machine, changes.remove, 1)
    assert left == build((1, 0, 1), (2, 1, 1), (2, 1, 3))
    assert chosen == 0


def test_the_given_blocks_stay() -> None:
    reason = "block 0, the Starting Block, cannot be removed"
    assert why_not(CAR, changes.remove, 0) == reason
    assert why_not(CAR, changes.move, 0, (1, 0)) == reason.replace("removed", "moved")


def test_moving_takes_along_what_is_attached() -> None:
    machine = add(add(BRIEF.given, BLOCK, (0, 0)), WHEEL, (1, 0))
    moved, chosen = make(machine, changes.move, 1, (0, 1))
    assert moved == build((1, 0, 1), (2, 1, 0))
    assert chosen == 1


def test_a_block_can_be_moved_to_a_later_one_but_not_to_what_it_carries() -> None:
    machine = build((1, 0, 0), (1, 0, 1), (2, 1, 0))
    moved, chosen = make(machine, changes.move, 1, (2, 0))
    assert moved == build((1, 0, 1), (1, 1, 0), (2, 2, 0))
    assert chosen == 2
    assert "carries block 3" in why_not(machine, changes.move, 1, (3, 0))


def test_turning_goes_through_the_legal_faces_and_back() -> None:
    machine, faces = add(BRIEF.given, BLOCK, (0, 2)), []
    for _ in range(6):
        machine, _ = Mending(machine, BRIEF).turn(1)
        faces.append(machine[1].face_id)
    assert faces == [3, 4, 5, 0, 1, 2]


def test_a_copy_has_its_own_springs_and_leaves_shared_ones() -> None:
    machine = build((1, 0, 0), (1, 1, 0))
    machine = add(add(machine, SPRING, (1, 5), (2, 5)), SPRING, (0, 4), (2, 6))
    copied, chosen = make(machine, changes.copy, 1, (0, 1))
    assert chosen == 5
    assert [step.type for step in copied][5:] == [BLOCK, BLOCK, SPRING]
    assert copied[7].attachments == ((5, 5), (6, 5))


def mirrored(points: Sequence[tuple[float, float, float]]) -> set[tuple[float, float, float]]:
    return {(-x + 0.0, y, z) for x, y, z in points}


@pytest.mark.parametrize("block", [3, 5])
def test_a_mirror_image_is_left_where_the_block_is_right(block: int) -> None:
    half = build((1, 0, 0), (1, 0, 1), (2, 1, 1), (1, 3, 0), (2, 2, 1), (15, 5, 0))
    whole, chosen = make(half, changes.mirror, block)
    geometry = place(whole)
    right = [geometry[item].center for item in carried_by(half, block)]
    left = [geometry[item].center for item in range(len(half), len(whole))]
    assert mirrored(right) == set(left)
    assert chosen == len(half)


def test_a_mirror_image_of_a_block_on_a_side_arm_goes_to_the_other_arm() -> None:
    arms = build((1, 0, 2), (1, 0, 3), (2, 1, 0))
    whole, _ = make(arms, changes.mirror, 3)
    assert whole[4].attachments == ((2, 0),)
    lone = build((1, 0, 2), (2, 1, 0))
    assert "has no mirror image to attach to; mirror it first" in why_not(lone, changes.mirror, 2)


def test_a_machine_with_problems_can_be_mended_one_by_one() -> None:
    broken = build((1, 0, 0), (2, 1, 1), (2, 1, 2), (2, 1, 3), (2, 1, 4))
    assert not check(broken, BRIEF).machine_valid
    first, _ = make(broken, changes.remove, 3)
    assert not check(first, BRIEF).machine_valid
    second, _ = make(first, changes.remove, 4)
    assert check(second, BRIEF).machine_valid


MACHINES = Path(__file__).parent.parent / "machines"


@pytest.mark.parametrize("family", ["throwing", "movement", "lifting"])
def test_every_reference_machine_can_be_built_block_by_block(family: str) -> None:
    """Catapults with springs and braces are among them."""
    references = yaml.safe_load((MACHINES / f"{family}.yaml").read_text())["references"]
    known = {item["machine"]: item["level"] for item in reversed(references)}
    for file, level in known.items():
        wanted, brief = read_one(str(MACHINES / file)), get_task(level).brief
        machine = Machine(wanted.steps[: len(brief.given)])
        for step in wanted.steps[len(brief.given) :]:
            change = partial(changes.add, kind=step.type, ends=step.attachments)
            machine, chosen = Mending(machine, brief).make(change)
            assert chosen == step.id
        assert machine.steps == wanted.steps
        assert check(machine, brief).task_valid
