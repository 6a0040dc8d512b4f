"""Edits that replace, mirror, set numbers and move ends, and faces named by direction."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.agents.history import EditRecord, History
from agentflow.machine import Brief, Machine, apply_script, check, library, place
from agentflow.machine.brief import Limits
from agentflow.machine.edits.commands import (
    Add,
    Mirror,
    Move,
    Replace,
    SetControl,
    command_text,
    read_command,
)
from agentflow.machine.edits.difference import renumbering
from agentflow.machine.edits.random import random_machine
from agentflow.machine.geometry.pose import FACINGS
from agentflow.machine.tree import Control, carried_by
from tests.machine.builders import CAR, build
from tests.machine.strategies import controlled_machines, valid_machines

DRIVEN = replace(CAR, controls=(Control("motors", 0.0, 5.0, 1.0), Control((4, 6), 0.5, 2.0, -1.0)))
"""The car, whose blocks 3 to 6 are its wheels."""
DESIGNED, FIXED, FEW = (
    Brief("t", "o", (), (), (), tuple(range(64)), limits=limits)
    for limits in (Limits(controls=5.0), Limits(), Limits(blocks=9))
)
SPRUNG = build((1, 0, 0), (9, 0, 4, 1, 5), (15, 0, 1))


def edited(machine: Machine, script: str, brief: Brief | None = None) -> Machine:
    outcome = apply_script(machine, script, brief)
    assert outcome.success, outcome.steps
    return outcome.machine


def told(machine: Machine, script: str) -> list[str]:
    outcome = apply_script(machine, script, DESIGNED)
    assert outcome.success, outcome.steps
    return outcome.changes


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("Replace 7 with 41", Replace(7, 41)),
        ("2. replace [7] with [41].", Replace(7, 41)),
        ("Replace mast with 41", Replace("mast", 41)),
        ("Replace 7 by 41", None),
        ("Mirror 3", Mirror(3)),
        ("mirror [x-]", Mirror("x-")),
        ("Mirror arm", Mirror("arm")),
        ("Mirror y+", None),
        ("Mirror", None),
        ("Move 9 end b to 5 in 2", Move(9, 5, 2, "b")),
        ("Move [9] end [a] to [5] in [x+]", Move(9, 5, "x+", "a")),
        ("Move end to 5 in 2", Move("end", 5, 2)),
        ("Move 9 end c to 5 in 2", None),
        ("Add 15 to 2 in x+", Add(15, ((2, "x+"),))),
        ("Add 15 to 2 in [x+ z-] as a", Add(15, ((2, "x+z-"),), "a")),
        ("Add 15 to face x+ at 2", Add(15, ((2, "x+"),))),
        ("Add 9 to [face x+ z- at 2] to 4 in 3", Add(9, ((2, "x+z-"), (4, 3)))),
        ("Add 9 to face x+ z- at 2 to face 3 at a", Add(9, ((2, "x+z-"), ("a", 3)))),
        ("Move 4 to face [y-] at [2]", Move(4, 2, "y-")),
        ("Add 15 to 2 in +x", None),
        ("Add 15 to 2 in x+x+x+x+", None),
        ("Set 5 for 2.158", SetControl(5, (("for", 2.158),))),
        ("Set [5] level -1 at 0.5 s", SetControl(5, (("level", -1.0), ("at", 0.5)))),
        ("Set 5", None),
        ("Set 5 for 2 for 3", None),
        ("Set 5 for .", None),
        ("Set motors for 2", None),
    ],
)
def test_reading_commands(line: str, command: object) -> None:
    assert read_command(line) == command


@pytest.mark.parametrize(
    "line",
    [
        "Replace 7 with 41",
        "Mirror 3",
        "Mirror x-",
        "Move 9 end b to 5 in x+z-",
        "Set 5 at 0.5 for 2.158",
    ],
)
def test_a_command_is_told_as_it_is_written(line: str) -> None:
    command = read_command(line)
    assert command is not None
    assert "".join(map(str, command_text(command))) == line


def test_set_changes_only_the_numbers_it_names_and_says_what_changed() -> None:
    script = "Set 1 for 2.158 level -0.5\nSet 0 at 1 for 4"
    assert edited(DRIVEN, script, DESIGNED).controls == (
        Control("motors", 1.0, 4.0, 1.0),
        Control((4, 6), 0.5, 2.158, -0.5),
    )
    assert told(DRIVEN, script) == [
        "control 1 (block 4, block 6): for 2 s -> 2.158 s, level -1 -> -0.5",
        "control 0 (motors): at 0 s -> 1 s, for 5 s -> 4 s",
    ]
    assert told(DRIVEN, "Uncontrol 1") == [
        "control 1 (block 4, block 6), at 0.5 s for 2 s level -1, is removed"
    ]


@pytest.mark.parametrize(
    ("machine", "script", "code", "reason"),
    [
        (DRIVEN, "Set 2 for 1", "control_not_found", "no control 2; the controls are 0 to 1"),
        (DRIVEN, "Uncontrol 1\nSet 1 for 1", "control_not_found", "removed earlier"),
        (DRIVEN, "Set 1 for 5", "control_time", "ends at 5.5 s, after the window"),
        (DRIVEN, "Set 1 level 2", "control_level", "level 2 is not from -1 to 1"),
        (DRIVEN, "Set 1 for 2.0001", "no_change", "control 1 has for 2 already"),
        (CAR, "Replace 0 with 1", "starting_block", "cannot be replaced"),
        (CAR, "Replace 9 with 1", "block_not_found", "block 9 does not exist"),
        (CAR, "Replace 3 with 2", "no_change", "has type 2 already"),
        (CAR, "Replace 3 with 9", "two_ended", "type 9 (Spring) is two-ended"),
        (CAR, "Replace 3 with 99", "unknown_type", "type 99 is unknown"),
        (CAR, "Replace 1 with 2", "face_not_found", "block 3 (Powered Wheel) is on face 1 (Left)"),
        (CAR, "Replace 3 with 46", "overlap", "block 3 (Large Powered Wheel) overlap by"),
        (SPRUNG, "Replace 1 with 27", "face_not_found", "block 2 (Spring) is on face 5 (Up)"),
        (SPRUNG, "Move 1 end a to 0 in 2", "two_ended", "block 1 (Wooden Block) has no end a"),
        (SPRUNG, "Move 2 end a to 0 in 4", "no_change", "already on face 4"),
        (SPRUNG, "Move 2 end a to 3 in 0", "parent_not_earlier", "does not come before"),
        (SPRUNG, "Move 2 end b to 1 in 9", "face_not_found", "has no face 9"),
        (CAR, "Mirror 0", "not_mirrored", "its own mirror image"),
        (CAR, "Mirror 3", "no_change", "has its mirror image already"),
        (CAR, "Mirror x+", "no_change", "every block there has its mirror image already"),
        (build((1, 0, 2), (2, 1, 0)), "Mirror 2", "not_mirrored", "mirror it first"),
        (CAR, "Add 15 to 1 in x+", "ambiguous_face", "faces 3, 4 of block 1 (Wooden Block)"),
        (CAR, "Add 15 to 1 in x+y+", "ambiguous_face", "as in x+y+z+"),
        (CAR, "Add 15 to 3 in y+", "face_not_found", "its faces look: 0 x-"),
        (SPRUNG, "Add 15 to 2 in y+", "face_not_found", "its faces look: none"),
    ],
)
def test_refusals_say_what_to_change(machine: Machine, script: str, code: str, reason: str) -> None:
    outcome = apply_script(machine, script, DESIGNED)
    assert outcome.machine is machine
    (step,) = (step for step in outcome.steps if step.verdict == "Error")
    assert (step.code, reason in step.reason) == (code, True), step.reason


def test_a_schedule_and_a_number_of_blocks_hold_for_the_new_commands() -> None:
    assert apply_script(CAR, "Set 0 for 1", FIXED).steps[0].code == "controls_not_allowed"
    half = edited(CAR, "Add 15 to 3 in 0\nAdd 15 to 5 in 0")
    outcome = apply_script(half, "Mirror x-", FEW)
    assert outcome.steps[0].code == "too_many_blocks"
    assert len(edited(half, "Mirror x-")) == 10


def test_an_end_moves_and_the_other_stays() -> None:
    assert edited(SPRUNG, "Move 2 end b to 1 in 0")[2].attachments == ((0, 4), (1, 0))
    moved = edited(SPRUNG, "Add 15 to 1 in 0 as tip\nMove 2 end a to tip in y+")
    assert [step.type for step in moved] == [0, 1, 15, 15, 9]  # ends come after what holds them
    assert moved[4].attachments == ((3, 3), (1, 5))


def test_what_is_on_a_replaced_block_keeps_its_place_if_it_can() -> None:
    log = build((63, 0, 0), (15, 1, 6), (15, 1, 1), (7, 1, 9, 0, 4))
    short = edited(log, "Replace 1 with 1")
    assert [step.attachments for step in short.steps[2:]] == [
        ((1, 4),),
        ((1, 1),),
        ((1, 6), (0, 4)),
    ]
    assert told(log, "Replace 1 with 1") == [
        "block 1 (Log) -> type 1 (Wooden Block); block 2: face 6 to 4 of block 1; "
        "block 4: face 9 to 6 of block 1"
    ]


def test_a_block_that_nothing_drives_leaves_its_controls() -> None:
    unpowered = "Replace 4 with 40\nReplace 6 with 40"
    assert edited(DRIVEN, unpowered, DESIGNED).controls == DRIVEN.controls[:1]
    assert told(DRIVEN, unpowered)[0] == (
        "block 4 (Powered Wheel) -> type 40 (Unpowered Wheel); control 1 no longer names it"
    )
    refused = apply_script(DRIVEN, unpowered + "\nReplace 3 with 40\nReplace 5 with 40", DESIGNED)
    assert (refused.success, refused.steps[3].code) == (False, "control_group")


def test_history_tells_what_changed_in_the_numbering_of_now() -> None:
    outcome = apply_script(DRIVEN, "Set 1 for 1 // shorter\nUncontrol 0", DESIGNED)
    history = History().add(EditRecord(outcome.annotated, "Success"))
    assert "Set 1 for 1  // control 1 (block 4, block 6): for 2 s -> 1 s" in history.to_text()
    after = apply_script(outcome.machine, "Remove 3", DESIGNED)
    now = renumbering(outcome.machine, after.id_map, after.names)
    assert "Set 1 for 1  // control 1 (block 3, block 5): for" in history.renumbered(now).to_text()


@pytest.mark.parametrize("facing", FACINGS)
@pytest.mark.parametrize("kind", [kind for kind in library() if library()[kind].faces])
def test_a_direction_is_the_face_that_looks_there(kind: int, facing: str) -> None:
    """Of a block of every type in every orientation, with every place among like faces."""
    brief = replace(DESIGNED, blocks=tuple(library()))
    on_root = "" if kind == 0 else f"Add {kind} to 0 in {facing}"
    machine = edited(build(), on_root, brief)
    placed = place(machine).blocks[-1]
    assert placed.facing == ("z+" if kind == 0 else facing)
    faces = [face for face in placed.faces if face.face_id not in library()[kind].closed]
    for looking in FACINGS:
        there = [face for face in faces if face.facing == looking]
        for way in ("", *FACINGS):
            far = {face.face_id: along(face.position, way) for face in there}
            wanted = [face for face, distance in far.items() if distance == max(far.values())]
            line = f"Add 7 to {placed.id} in {looking}{way} to 0 in 5"
            last = apply_script(machine, line, brief)
            if len(wanted) == 1:
                assert last.success, last.steps
                assert last.machine.steps[-1].face_id == wanted[0]
            else:
                code = "ambiguous_face" if wanted else "face_not_found"
                assert last.steps[0].code == code, last.steps


def along(position: tuple[float, float, float], way: str) -> float:
    return float(way[1] + "1") * position["xyz".index(way[0])] if way else 0.0


@settings(max_examples=60)
@given(valid_machines(), st.data())
def test_replace_keeps_everything_else(machine: Machine, data: st.DataObject) -> None:
    block = data.draw(st.integers(0, len(machine) - 1))
    kind = data.draw(st.sampled_from(sorted(library().core)))
    outcome = apply_script(machine, f"Replace {block} with {kind}")
    if not outcome.success:
        assert outcome.machine is machine
        return
    assert check(outcome.machine).machine_valid
    before, after = place(machine), place(outcome.machine)
    assert after[block].type == kind
    subtree = set(carried_by(machine, block))
    for old, new in zip(machine, outcome.machine, strict=True):
        assert (old.id, old.parents) == (new.id, new.parents)
        if old.id != block:
            assert old.type == new.type
            if not old.two_ended:
                assert before[old.id].facing == after[old.id].facing
        if block not in old.parents:
            assert old.attachments == new.attachments
        if old.id not in subtree:
            assert before[old.id] == after[old.id]


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.sampled_from(["x+", "x-"]))
def test_a_mirrored_side_is_symmetric_and_mirroring_it_again_changes_nothing(
    seed: int, side: str
) -> None:
    machine = random_machine(Random(seed), size=(3, 8))
    outcome = apply_script(machine, f"Mirror {side}")
    if not outcome.success:
        assert outcome.machine is machine
        return
    grown = outcome.machine
    assert grown.steps[: len(machine)] == machine.steps  # additions come last
    assert check(grown).machine_valid
    geometry = place(grown)
    where = {(b.type, b.lo, b.hi) for b in geometry.blocks if not b.two_ended}
    sign = 1 if side == "x+" else -1
    for b in geometry.blocks:
        if not b.two_ended and sign * (b.lo[0] + b.hi[0]) > 0:
            assert (b.type, (-b.hi[0], *b.lo[1:]), (-b.lo[0], *b.hi[1:])) in where
    again = apply_script(grown, f"Mirror {side}")
    assert again.steps[0].code == "no_change"


def test_some_random_machines_can_be_mirrored() -> None:
    done = sum(
        apply_script(random_machine(Random(seed), size=(3, 8)), "Mirror x+").success
        for seed in range(40)
    )
    assert done >= 5, done


@settings(max_examples=30)
@given(controlled_machines(), st.data())
def test_set_and_set_back_is_no_change(machine: Machine, data: st.DataObject) -> None:
    if not machine.controls:
        return
    number = data.draw(st.integers(0, len(machine.controls) - 1))
    entry = machine.controls[number]
    lasts = data.draw(st.integers(1, 9000)) / 1000
    outcome = apply_script(machine, f"Set {number} for {lasts}")
    if lasts == entry.lasts:
        assert outcome.steps[0].code == "no_change"
        return
    assert outcome.machine.steps == machine.steps
    assert edited(outcome.machine, f"Set {number} for {entry.lasts}") == machine


WORDS = (
    "add move replace with mirror set control uncontrol face at to in end a b x+ x- y+z- z+z+z+ "
    "for level as 0 1 3 4 -1 99 2.158 1e9 [ ] [x+] nan inf motors // ** . +"
)


@settings(max_examples=300)
@given(
    st.lists(st.sampled_from(WORDS.split()) | st.text(max_size=6), max_size=14).map(" ".join),
    st.booleans(),
)
def test_hostile_lines_are_answered_and_change_nothing_or_leave_a_valid_machine(
    line: str, designed: bool
) -> None:
    outcome = apply_script(DRIVEN, line, DESIGNED if designed else None)
    assert len(outcome.steps) >= 1
    if outcome.success:
        assert check(outcome.machine).machine_valid
    else:
        assert outcome.machine is DRIVEN
        (error,) = (step for step in outcome.steps if step.verdict == "Error")
        assert error.code
        assert error.reason


@pytest.mark.parametrize(
    "line",
    [
        "face " * 20_000,
        "Mirror " + "[" * 50_000,
        "set 1" + " at 1" * 9**5,
        "add 1 to " + "face x+ at 2 to " * 9000,
        "move 3 end a to 1 in " + "x+ " * 30_000,
    ],
)
def test_long_hostile_lines_are_answered_at_once(line: str) -> None:
    assert apply_script(CAR, line).steps[0].code == "bad_format"
