"""Limits of machines: blocks of a task, two-ended blocks per pair of faces, parts in one piece."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, Step, apply_script, check, describe_text, place
from agentflow.machine.brief import Limits
from agentflow.machine.edits.random import random_edit, random_machine
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates
from agentflow.machine.geometry.pieces import largest_piece
from agentflow.machine.validity import spatial_problems
from tests.machine.builders import build

TASK = Brief("throwing", "Throw.", (), (), (), (0, 1, 7, 9, 15, 36, 63))
ROW = build((15, 0, 0), (15, 1, 0), (15, 2, 0), (15, 3, 0))


def allowing(blocks: int | None, **changes: object) -> Brief:
    return replace(TASK, limits=Limits(blocks=blocks), **changes)


def told(machine: Machine, brief: Brief | None = None) -> list[tuple[str, tuple[int, ...], str]]:
    return [(item.code, item.blocks, item.message) for item in check(machine, brief).problems]


def test_the_root_counts_as_a_block() -> None:
    assert told(ROW, allowing(5)) == []
    assert told(ROW, allowing(3)) == [
        (
            "too_many_blocks",
            (),
            "the machine has 5 blocks; this task allows at most 3: remove at least 2",
        )
    ]


def test_a_machine_whose_only_fault_is_the_budget_is_valid_without_the_task() -> None:
    report = check(ROW, allowing(3))
    assert (report.machine_valid, report.task_valid) == (True, False)
    assert check(ROW).task_valid


def test_without_a_limit_any_number_is_allowed() -> None:
    assert told(ROW, allowing(None)) == []


def test_given_blocks_do_not_count() -> None:
    brief = allowing(1, given=build((15, 0, 0), (15, 1, 0)))
    assert told(build((15, 0, 0), (15, 1, 0), (15, 2, 0)), brief) == []
    (problem,) = check(ROW, brief).problems
    assert problem.message == (
        "the machine has 2 blocks besides the 3 given; this task allows at most 1: "
        "remove at least 1"
    )


def test_an_edit_may_not_exceed_the_budget() -> None:
    outcome = apply_script(ROW, "Add 15 to 0 in 4\nAdd 15 to 0 in 5\nRemove 4", allowing(6))
    assert [step.verdict for step in outcome.steps] == ["Success", "Error", "Unverified"]
    assert (outcome.steps[1].code, outcome.steps[1].reason) == (
        "too_many_blocks",
        "with this block the machine has 7 blocks; this task allows at most 6: "
        "remove at least 1 in an earlier line",
    )
    assert apply_script(ROW, "Remove 4\nAdd 15 to 0 in 5", allowing(5)).success


def test_an_edit_may_bring_a_machine_back_within_the_budget() -> None:
    assert apply_script(ROW, "Remove 4", allowing(3)).success


def test_random_machines_and_edits_stay_within_the_budget() -> None:
    brief, rng = allowing(12, required={36: 1}), Random(3)
    for _ in range(5):
        machine = random_machine(rng, brief, (5, 60))
        assert len(machine) <= 12
    machine = random_machine(rng, brief, (12, 12))
    for _ in range(40):
        machine = random_edit(machine, rng, brief)
        assert check(machine, brief).task_valid


def test_a_budget_of_one_block_allows_the_lone_root_only() -> None:
    assert random_machine(Random(0), allowing(1)) == build()
    with pytest.raises(UsageError, match="this machine has no legal edit"):
        random_edit(build(), Random(0), allowing(1))


def test_the_description_says_how_many_blocks_of_how_many() -> None:
    for short in (False, True):
        assert describe_text(ROW, allowing(40), short=short).splitlines()[1] == ("5 of 40 blocks.")
        assert describe_text(ROW, TASK, short=short) == describe_text(ROW, short=short)
    given = allowing(40, given=build((15, 0, 0), (15, 1, 0)))
    assert "\n2 of 40 blocks.\n" in describe_text(ROW, given)


@pytest.mark.parametrize("kind", [7, 9])
@pytest.mark.parametrize("ends", [(0, 4, 2, 3), (2, 3, 0, 4)])
def test_two_ended_blocks_of_a_type_may_not_join_the_same_faces(
    kind: int, ends: tuple[int, int, int, int]
) -> None:
    machine = Machine((*ROW.steps, Step(5, kind, 0, 4, 2, 3), Step(6, kind, *ends)))
    name = {7: "Brace", 9: "Spring"}[kind]
    message = (
        f"blocks 5, 6 ({name}) join the same two faces, face 4 of block 0 (Starting Block) and "
        "face 3 of block 2 (Small Wooden Block); only one block of a type may do so: "
        "attach the others elsewhere"
    )
    assert told(machine) == [("duplicate_connection", (5, 6), message)]
    assert not check(machine).machine_valid


def test_other_types_and_other_faces_are_other_connections() -> None:
    machine = build(
        (15, 0, 0), (15, 1, 0), (9, 0, 4, 2, 3), (7, 0, 4, 2, 3), (9, 0, 4, 2, 4), (9, 0, 5, 2, 3)
    )
    assert check(machine).machine_valid


def test_an_edit_may_not_double_a_connection() -> None:
    machine = Machine((*ROW.steps, Step(5, 9, 0, 4, 2, 3)))
    (step,) = apply_script(machine, "Add 9 to 2 in 3 to 0 in 4").steps
    assert step.code == "duplicate_connection"
    assert step.reason.startswith("with Spring as new block 6: blocks 5, 6 (Spring) join the same")


def test_doubled_connections_are_found_in_coordinates() -> None:
    machine = Machine((*ROW.steps, Step(5, 9, 0, 4, 2, 3), Step(6, 9, 2, 3, 0, 4)))
    report = check(read_coordinates(to_coordinates(machine)))
    assert [problem.code for problem in report.problems] == ["duplicate_connection"]


def test_random_machines_double_no_connection() -> None:
    """Where springs between a few faces are almost all there is."""
    brief = replace(TASK, blocks=(0, 9, 15), required={15: 1})
    machine = random_machine(Random(1), brief, (25, 25))
    assert machine.count(9) == 23
    assert check(machine, brief).task_valid


@pytest.mark.parametrize(
    ("machine", "parts"),
    [
        (ROW, 5),
        (build((15, 0, 0), (7, 0, 4, 1, 3)), 4),  # a brace is two parts
        (build((15, 0, 0), (50, 1, 0)), 4),  # so is a caster: fork and wheel
        (build((36, 0, 4)), 1),  # a boulder lies loose
        (build((15, 0, 0), (9, 0, 4, 1, 3)), 4),  # each end of a spring belongs to its parent
    ],
)
def test_parts_of_the_largest_piece(machine: Machine, parts: int) -> None:
    assert largest_piece(place(machine)) == parts


def test_more_parts_in_one_piece_than_the_engine_holds() -> None:
    geometry = place(ROW)
    assert spatial_problems(geometry, Limits(parts=5)) == []
    (problem,) = spatial_problems(geometry, Limits(parts=4))
    assert (problem.code, problem.message) == (
        "too_many_parts",
        "the machine has 5 parts in one piece; the physics engine holds at most 4: "
        "remove blocks (a two-ended block has 2 parts, a moving joint in a loop counts as one "
        "more)",
    )
    brief = replace(TASK, limits=Limits(parts=5))
    (step,) = apply_script(ROW, "Add 15 to 0 in 4", brief).steps
    assert step.code == "too_many_parts"


def test_blocks_in_different_pieces_do_not_add_up() -> None:
    boulders = build((36, 0, 4), (36, 0, 5))
    assert check(boulders, limits=Limits(parts=1)).machine_valid
