"""Building by hand: where blocks can go, and what is shown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agentflow.app.tasks import find_task
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine import check, place
from agentflow.machine.blocks.library import BOULDER
from agentflow.machine.edits import changes
from agentflow.machine.edits.changes import Mending
from agentflow.studio.building.state import describe_block, describe_state, spots_to_add
from tests.machine.builders import CAR, build
from tests.machine.test_changes import BLOCK, BRIEF, SPRING, WHEEL, add, why_not


def test_every_spot_says_what_making_it_would_do() -> None:
    rules = Mending(CAR, BRIEF)
    spots = list(spots_to_add(rules, WHEEL))
    assert {bool(spot["why_not"]) for spot in spots} == {True, False}
    for spot in spots:
        if spot["why_not"]:
            assert "overlap by" in spot["why_not"]
            assert (
                why_not(CAR, changes.add, WHEEL, [(spot["block"], spot["face"])]) == spot["why_not"]
            )
        else:
            assert check(add(CAR, WHEEL, (spot["block"], spot["face"])), BRIEF).machine_valid


def test_only_free_faces_are_offered_to_blocks_and_all_faces_to_two_ended_ones() -> None:
    machine = add(BRIEF.given, BLOCK, (0, 0))
    rules = Mending(machine, BRIEF)
    assert (0, 0) not in {(spot["block"], spot["face"]) for spot in spots_to_add(rules, BLOCK)}
    firsts = list(spots_to_add(rules, SPRING))
    assert (0, 0) in {(spot["block"], spot["face"]) for spot in firsts}
    assert not any(spot["why_not"] for spot in firsts)
    seconds = list(spots_to_add(rules, SPRING, (0, 2)))
    assert (0, 2) not in {(spot["block"], spot["face"]) for spot in seconds}


def test_a_second_spring_between_the_same_faces_is_refused() -> None:
    machine = add(add(BRIEF.given, BLOCK, (0, 0)), SPRING, (0, 4), (1, 5))
    again = next(
        spot
        for spot in spots_to_add(Mending(machine, BRIEF), SPRING, (1, 5))
        if (spot["block"], spot["face"]) == (0, 4)
    )
    assert "join the same two faces" in again["why_not"]


def test_blocks_that_the_task_does_not_allow_are_refused() -> None:
    allowed = replace(BRIEF, blocks=(0, BLOCK))
    for kind, reason in ((WHEEL, "is not allowed here"), (4711, "is unknown"), (0, "Starting")):
        with pytest.raises(UsageError, match=reason):
            list(spots_to_add(Mending(BRIEF.given, allowed), kind))


def test_no_face_fits_a_block_of_which_the_task_has_enough_but_one_too_many_can_go() -> None:
    brief = find_task("throwing").brief
    one = build((BOULDER, 0, 0))
    assert not any(spot["why_not"] for spot in spots_to_add(Mending(BRIEF.given, brief), BOULDER))
    for spot in spots_to_add(Mending(one, brief), BOULDER):
        assert "requires exactly 1 block" in spot["why_not"]
    three = build(*((BOULDER, 0, face) for face in range(3)))
    fewer, _ = Mending(three, brief).make(lambda draft: changes.remove(draft, 3))
    assert fewer.count(BOULDER) == 2


def test_a_block_is_shown_where_it_does_not_fit_with_the_way_that_its_motor_turns() -> None:
    machine = build((1, 0, 0), (WHEEL, 1, 1))
    for face, axis in ((2, "x"), (0, "z")):
        ghost = describe_block(machine, BRIEF, WHEEL, [(1, face)])
        assert [row[0] for row in ghost["solids"]] == ["cylinder", "box"]
        assert [abs(part) for part in ghost["turn"]["axis"]] == [axis == each for each in "xyz"]
    assert describe_block(CAR, BRIEF, SPRING, [(0, 4), (1, 5)])["turn"] is None


def test_a_block_is_fixed_by_a_move_to_a_face_where_nothing_overlaps() -> None:
    crowded = build((1, 0, 0), (WHEEL, 1, 1), (WHEEL, 1, 2))
    assert not check(crowded, BRIEF).machine_valid
    fixed, chosen = Mending(crowded, BRIEF).fix(3)
    assert check(fixed, BRIEF).machine_valid
    assert fixed[chosen].type == WHEEL


def test_the_state_tells_what_check_and_geometry_tell() -> None:
    state = describe_state(CAR, get_task("movement"), 3)
    assert (state["machine"], state["chosen"], state["valid"]) == (CAR.to_json(), 3, True)
    assert [block["id"] for block in state["blocks"]] == list(range(7))
    assert state["size"] == list(place(CAR).size)
    assert state["stands"]
    assert len(state["support"]) == 4
    assert state["count"] == 7
