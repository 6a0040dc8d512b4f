"""Changes by hand: what is legal and why not, copies and mirror images, and what is shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from agentflow.app.machines.files import read_one
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, check, place
from agentflow.machine.tree import Control
from agentflow.studio.building import changes
from agentflow.studio.building.rules import Rules
from agentflow.studio.building.state import describe_state
from tests.machine.builders import CAR, build

BRIEF: Brief = get_task("movement").brief
BLOCK, WHEEL, SPRING, LOG = 1, 2, 9, 63


def make(machine: Machine, change: changes.Change) -> tuple[Machine, int]:
    return Rules(machine, BRIEF).make(change)


def add(machine: Machine, kind: int, *ends: changes.End) -> Machine:
    return make(machine, changes.add(machine, kind, ends))[0]


def why_not(machine: Machine, change: changes.Change) -> str:
    return Rules(machine, BRIEF).why_not(change)


def test_a_car_is_built_block_by_block() -> None:
    machine = BRIEF.given
    for kind, *end in ((1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 1, 3), (2, 2, 1), (2, 2, 3)):
        machine = add(machine, kind, (end[0], end[1]))
    assert machine == CAR


def test_changes_keep_the_control_program() -> None:
    program = (Control((3, 4), 0, 1, 0.5), Control((6,), 1, 1, 1))
    changed, _ = make(replace(CAR, controls=program), changes.remove(CAR, 4))
    assert changed.controls == (Control((3,), 0, 1, 0.5), Control((5,), 1, 1, 1))


def test_every_spot_says_what_making_it_would_do() -> None:
    rules = Rules(CAR, BRIEF)
    spots = list(rules.spots_to_add(WHEEL))
    assert {bool(spot.why_not) for spot in spots} == {True, False}
    for spot in spots:
        change = changes.add(CAR, WHEEL, [(spot.block, spot.face)])
        if spot.why_not:
            with pytest.raises(UsageError, match="overlap by"):
                rules.make(change)
        else:
            assert check(rules.make(change)[0], BRIEF).machine_valid


def test_the_reason_names_the_blocks_that_would_overlap() -> None:
    machine = add(add(BRIEF.given, BLOCK, (0, 0)), WHEEL, (1, 1))
    reason = why_not(machine, changes.add(machine, WHEEL, [(1, 2)]))
    assert reason == (
        "block 3 (Powered Wheel) and block 2 (Powered Wheel) overlap by 0.5 x 2.0 x 1.0 m"
    )


def test_only_free_faces_are_offered_to_blocks_and_all_faces_to_two_ended_ones() -> None:
    machine = add(BRIEF.given, BLOCK, (0, 0))
    rules = Rules(machine, BRIEF)
    assert (0, 0) not in {(spot.block, spot.face) for spot in rules.spots_to_add(BLOCK)}
    firsts = list(rules.spots_to_add(SPRING))
    assert (0, 0) in {(spot.block, spot.face) for spot in firsts}
    assert not any(spot.why_not for spot in firsts)
    seconds = list(rules.spots_to_add(SPRING, (0, 2)))
    assert (0, 2) not in {(spot.block, spot.face) for spot in seconds}


def test_a_second_spring_between_the_same_faces_is_refused() -> None:
    machine = add(add(BRIEF.given, BLOCK, (0, 0)), SPRING, (0, 4), (1, 5))
    again = next(
        spot
        for spot in Rules(machine, BRIEF).spots_to_add(SPRING, (1, 5))
        if (spot.block, spot.face) == (0, 4)
    )
    assert "join the same two faces" in again.why_not


def test_blocks_that_the_task_does_not_allow_are_refused() -> None:
    allowed = replace(BRIEF, blocks=(0, BLOCK))
    for kind, reason in ((WHEEL, "is not allowed here"), (4711, "is unknown"), (0, "Starting")):
        with pytest.raises(UsageError, match=reason):
            list(Rules(BRIEF.given, allowed).spots_to_add(kind))


def test_removing_takes_all_that_is_attached_and_two_ended_blocks() -> None:
    machine = add(CAR, SPRING, (1, 5), (2, 5))
    left, chosen = make(machine, changes.remove(machine, 1))
    assert left == build((1, 0, 1), (2, 1, 1), (2, 1, 3))
    assert chosen == 0


def test_the_given_blocks_stay() -> None:
    for change in (changes.remove(CAR, 0),):
        assert why_not(CAR, change) == "the root is given by the task, so it stays as it is"


def test_moving_takes_along_what_is_attached() -> None:
    machine = add(add(BRIEF.given, BLOCK, (0, 0)), WHEEL, (1, 0))
    moved, chosen = make(machine, changes.move(machine, 1, (0, 1)))
    assert moved == build((1, 0, 1), (2, 1, 0))
    assert chosen == 1


def test_a_block_can_be_moved_to_a_later_one_but_not_to_what_it_carries() -> None:
    machine = build((1, 0, 0), (1, 0, 1), (2, 1, 0))
    moved, chosen = make(machine, changes.move(machine, 1, (2, 0)))
    assert moved == build((1, 0, 1), (1, 1, 0), (2, 2, 0))
    assert chosen == 2
    with pytest.raises(UsageError, match="carries block 3"):
        changes.move(machine, 1, (3, 0))


def test_turning_goes_through_the_legal_faces_and_back() -> None:
    machine, faces = add(BRIEF.given, BLOCK, (0, 2)), []
    for _ in range(6):
        machine, _ = make(machine, Rules(machine, BRIEF).turned(1))
        faces.append(machine[1].face_id)
    assert faces == [3, 4, 5, 0, 1, 2]


def test_a_copy_has_its_own_springs_and_leaves_shared_ones() -> None:
    machine = build((1, 0, 0), (1, 1, 0))
    machine = add(add(machine, SPRING, (1, 5), (2, 5)), SPRING, (0, 4), (2, 6))
    copied, chosen = make(machine, changes.copy(machine, 1, (0, 1)))
    assert chosen == 5
    assert [step.type for step in copied][5:] == [BLOCK, BLOCK, SPRING]
    assert copied[7].attachments == ((5, 5), (6, 5))


def mirrored(points: Sequence[tuple[float, float, float]]) -> set[tuple[float, float, float]]:
    return {(-x + 0.0, y, z) for x, y, z in points}


@pytest.mark.parametrize("block", [3, 5])
def test_a_mirror_image_is_left_where_the_block_is_right(block: int) -> None:
    half = build((1, 0, 0), (1, 0, 1), (2, 1, 1), (1, 3, 0), (2, 2, 1), (15, 5, 0))
    whole, chosen = make(half, changes.mirror(half, block))
    geometry = place(whole)
    right = [geometry[item].center for item in changes.subtree(half, block)]
    left = [geometry[item].center for item in range(len(half), len(whole))]
    assert mirrored(right) == set(left)
    assert chosen == len(half)


def test_a_mirror_image_of_a_block_on_a_side_arm_goes_to_the_other_arm() -> None:
    arms = build((1, 0, 2), (1, 0, 3), (2, 1, 0))
    whole, _ = make(arms, changes.mirror(arms, 3))
    assert whole[4].attachments == ((2, 0),)
    lone = build((1, 0, 2), (2, 1, 0))
    with pytest.raises(UsageError, match="has no mirror image to attach to; mirror it first"):
        changes.mirror(lone, 2)


def test_a_machine_with_problems_can_be_mended_one_by_one() -> None:
    broken = build((1, 0, 0), (2, 1, 1), (2, 1, 2), (2, 1, 3), (2, 1, 4))
    assert not check(broken, BRIEF).machine_valid
    first, _ = make(broken, changes.remove(broken, 3))
    assert not check(first, BRIEF).machine_valid
    second, _ = make(first, changes.remove(first, 4))
    assert check(second, BRIEF).machine_valid


def test_the_state_tells_what_check_and_geometry_tell() -> None:
    state = describe_state(CAR, BRIEF, 3)
    assert (state["machine"], state["chosen"], state["valid"]) == (CAR.to_json(), 3, True)
    assert [block["id"] for block in state["blocks"]] == list(range(7))
    assert state["size"] == list(place(CAR).size)
    assert state["stands"]
    assert len(state["support"]) == 4
    assert state["count"] == 7


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
            change = changes.add(machine, step.type, step.attachments)
            machine, chosen = Rules(machine, brief).make(change)
            assert chosen == step.id
        assert machine == wanted
        assert check(machine, brief).task_valid
