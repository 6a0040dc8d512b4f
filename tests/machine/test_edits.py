import pytest

from agentflow.machine import Brief, Machine, StepVerdict, apply_script, check
from agentflow.machine.brief import Limits
from agentflow.machine.edits.commands import Add, Command, Move, Remove, read_command, script_lines
from tests.machine.builders import CAR, CATAPULT, PUBLISHED_OVERLAP, build

CAGE = Brief("cage", "Move.", (), (), (), (0, 1, 15), {}, Limits((17.0, 2.0, 6.0)))


def refusals(table: str) -> list[tuple[str, str]]:
    """Scripts of a table, which writes them as a line, and the wrapped code and reason of each."""
    cases = (case.partition("\n") for case in table.strip().split("\n\n"))
    return [(script.replace("; ", "\n"), told.replace("\n", " ")) for script, _, told in cases]


def failure(machine: Machine, script: str, brief: Brief | None = None) -> tuple[str, str]:
    outcome = apply_script(machine, script, brief)
    assert not outcome.success
    assert outcome.machine is machine
    assert outcome.id_map == {step.id: step.id for step in machine}
    (step,) = (step for step in outcome.steps if step.verdict == "Error")
    return step.code, step.reason


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("Add [63] to [3] in [0]", Add(63, ((3, 0),))),
        ("add 63 to 3 in 0", Add(63, ((3, 0),))),
        ("1. ADD [ 63 ] TO [3] IN 0.", Add(63, ((3, 0),))),
        ("- **Add** `63` to 3 in 0;", Add(63, ((3, 0),))),
        ("* 2) Add 63 to 3 in 0 // the arm", Add(63, ((3, 0),))),
        ("Step 3: Add 63 to 3 in 0", Add(63, ((3, 0),))),
        ("(4) Add [9] to [1] in [2] to [3] in [4]", Add(9, ((1, 2), (3, 4)))),
        ("Remove [7]", Remove(7)),
        ("remove -1", Remove(-1)),
        ("Move [7]  to\t[2] in [4]", Move(7, 2, 4)),
        ("Add 63 to 3 in 0 as a", Add(63, ((3, 0),), "a")),
        ("add [63] to [Leg_1] in [0] as [2b]", Add(63, (("leg_1", 0),), "2b")),
        ("Add 9 to a in 2 to [ b ] in 4 as c.", Add(9, (("a", 2), ("b", 4)), "c")),
        ("Add 63 to 3 in 0 as 7", Add(63, ((3, 0),), "7")),
        ("Add 63 to toin in 0", Add(63, (("toin", 0),))),
        ("Remove a", Remove("a")),
        ("Move a to b in 4", Move("a", "b", 4)),
        ("Add63to3in0", Add(63, ((3, 0),))),
        ("Add 63 to 3 in 0 as my leg", None),
        ("Add 63 to 3 in 0 as", None),
        ("Add b to 3 in 0", None),
        ("Add 63 to 3.5 in 0", None),
        ("Add a Log to block 3", None),
        ("Add 63 to 3", None),
        ("Remove 7 and 8", None),
        ("Remove", None),
        ("Remove 7 Remove 8", None),
        ("Move 7 to 2 in 4 to 5 in 6", None),
        ("Add 1.5 to 3 in 0", None),
        ("Add 12345678901 to 3 in 0", None),
        ("-", None),
    ],
)
def test_reading_commands(line: str, command: Command | None) -> None:
    assert read_command(line) == command


def test_lines_that_are_not_commands_are_skipped() -> None:
    script = "```\n\n// first the wheel\n  Remove 7  \n```"
    assert script_lines(script) == ["Remove 7"]


def test_a_whole_script() -> None:
    outcome = apply_script(CAR, "1. Remove [3]\n2. Add [35] to [0] in [4]\n3. Move 4 to 1 in 1")
    assert outcome.success
    assert [(step.verdict, step.code, step.reason) for step in outcome.steps] == [
        ("Success", "", "")
    ] * 3
    assert outcome.machine == build(
        (1, 0, 0), (1, 0, 1), (2, 1, 1), (2, 2, 1), (2, 2, 3), (35, 0, 4)
    )
    assert outcome.id_map == {0: 0, 1: 1, 2: 2, 3: None, 4: 3, 5: 4, 6: 5}
    assert outcome.to_json() == {
        "outcome": "success",
        "steps": [
            {"text": text, "verdict": "Success", "code": "", "reason": ""}
            for text in ("1. Remove [3]", "2. Add [35] to [0] in [4]", "3. Move 4 to 1 in 1")
        ],
        "machine": outcome.machine.to_json(),
        "id_map": {"0": 0, "1": 1, "2": 2, "3": None, "4": 3, "5": 4, "6": 5},
    }


def test_a_move_takes_the_subtree_and_the_ends_on_it() -> None:
    machine = build((1, 0, 0), (1, 1, 5), (15, 2, 0), (9, 3, 1, 0, 4))
    moved = apply_script(machine, "Move 2 to 1 in 6").machine
    assert moved == build((1, 0, 0), (1, 1, 6), (15, 2, 0), (9, 3, 1, 0, 4))


def test_all_or_nothing() -> None:
    outcome = apply_script(CAR, "Remove 3\nRemove 3\nRemove 4\nnonsense")
    assert outcome.steps == (
        StepVerdict("Remove 3", "Success"),
        StepVerdict(
            "Remove 3", "Error", "block_removed", "block 3 was removed earlier in this script"
        ),
        StepVerdict("Remove 4", "Unverified"),
        StepVerdict("nonsense", "Unverified"),
    )
    assert outcome.machine is CAR
    assert outcome.to_json()["outcome"] == "failure"


REFUSED = """
Add 15 to 0 in 0
face_occupied: face 0 of block 0 (Starting Block) is already taken by block 3 (Wooden Block); free
faces of block 0: 4, 5

Remove 13; Add 15 to 0 in 4; Add 15 to 0 in 4
face_occupied: face 4 of block 0 (Starting Block) is already taken by block 14 (Small Wooden
Block); free faces of block 0: 5

Move 13 to 8 in 4
face_occupied: face 4 of block 8 (Wooden Block) is already taken by block 10 (Rotating Block);
free faces of block 8: 1, 2, 3, 5, 6, 7, 8

Add 15 to 0 in 6
face_not_found: block 0 (Starting Block) has no face 6; its faces are 0 to 5

Move 13 to 12 in 1
face_not_found: block 12 (Container) has no face 1; its only face is 0

Add 9 to 0 in 0 to 13 in 0
face_not_found: block 13 (Boulder) has no faces; nothing can be attached to it

Add 15 to 14 in 0
parent_not_found: block 14 does not exist; the blocks are 0 to 13

Add 15 to -1 in 0
parent_not_found: block -1 does not exist; the blocks are 0 to 13

Add 15 to 0 in 4; Add 15 to 14 in 0
parent_not_found: block 14 is added by this script; it can be used as a parent by name only: name
it, as in 'Add 15 to 0 in 4 as a'

Remove 14
block_not_found: block 14 does not exist; the blocks are 0 to 13

Add 15 to 0 in 4; Remove 14
block_not_found: block 14 is added by this script; it can be removed by name only: name it, as in
'Add 15 to 0 in 4 as a'

Add 15 to 0 in 4 as leg; Move 14 to 0 in 5
block_not_found: block 14 is added by this script; it can be moved by name only: use its name, leg

Remove 9; Add 15 to 9 in 0
parent_removed: block 9 was removed earlier in this script

Remove 9; Move 9 to 0 in 4
block_removed: block 9 was removed earlier in this script

Remove 8
has_children: block 8 (Wooden Block) still carries 9, 10; remove the blocks it carries first

Add 9 to 9 in 0 to 0 in 4; Remove 9
has_children: block 9 (Small Wooden Block) still carries 14; remove the blocks it carries first

Move 3 to 9 in 0
parent_not_earlier: new parent 9 does not come before block 3; a parent must have a smaller id or
be added by this script

Move 10 to 10 in 0
parent_not_earlier: new parent 10 does not come before block 10; a parent must have a smaller id
or be added by this script

Move 3 to 0 in 0
no_change: block 3 is already on face 0 of block 0

Remove 0
starting_block: block 0, the Starting Block, cannot be removed

Move 0 to 1 in 0
starting_block: block 0, the Starting Block, cannot be moved

Add 0 to 0 in 4
starting_block: type 0 is the Starting Block; only the first block may have it

Add 100 to 0 in 4
unknown_type: type 100 is unknown; the nearest types are 87 (Elastic Pad), 86 (Roller Wheel), 76
(Axle Connector)

Add 9 to 0 in 4
two_ended: type 9 (Spring) is two-ended; give two parents, each with a face

Add 15 to 0 in 4 to 1 in 5
two_ended: type 15 (Small Wooden Block) is not two-ended; give one parent and one face

Add 63 to 5 in 3
overlap: with Log as new block 14: block 14 (Log) and block 3 (Wooden Block) overlap by 1.0 x 1.0
x 1.0 m; free faces of block 5: 0, 1, 2, 4, 5, 6, 7, 8

Move 13 to 2 in 3
overlap: block 13 (Boulder) and block 3 (Wooden Block) overlap by 0.45 x 1.0 x 1.9 m; free faces
of block 2: 0, 1, 2, 5, 6, 7, 8

Move 4 to 3 in 1
overlap: block 4 (Wooden Block) and block 5 (Wooden Block) overlap by 1.0 x 1.0 x 1.0 m; free faces
of block 3: 0, 2, 3, 4, 5, 6, 7, 8

Remove 9; Add 35 to 3 in 7
size_limit: with Ballast as new block 14: the machine is 9.9 m along y, 0.4 m over the limit of
9.5 m; block 14 (Ballast) extends furthest to y- and block 13 (Boulder) to y+
"""
"""Edits of the catapult."""


@pytest.mark.parametrize(("script", "told"), refusals(REFUSED))
def test_failed_commands_and_reasons(script: str, told: str) -> None:
    assert ": ".join(failure(CATAPULT, script)) == told


@pytest.mark.parametrize("line", ["fly", "Add Log to 0 in 4", "## Steps", "Remove 13, 12"])
def test_a_line_that_is_not_a_command_is_an_error(line: str) -> None:
    assert failure(CATAPULT, line) == (
        "bad_format",
        "not a command; the commands are: Add [type] to [id] in [face]; "
        "Add [type] to [id_a] in [face_a] to [id_b] in [face_b]; Remove [id]; "
        "Move [id] to [new_parent] in [new_face]; "
        "Move [id] end [a or b] to [new_parent] in [new_face]; Replace [id] with [type]; "
        "Mirror [id, x+ or x-]; an Add line may end in 'as NAME', and later lines may use the "
        "name in place of an id; names consist of letters, digits and underscores",
    )


@pytest.mark.parametrize("script", ["", " \n\n", "```\n```", "// nothing"])
def test_a_script_without_commands_changes_nothing(script: str) -> None:
    outcome = apply_script(CATAPULT, script)
    assert outcome.success
    assert outcome.machine is CATAPULT
    assert outcome.id_map == {old: old for old in range(14)}
    reason = "the script has no commands, so the machine stays as it is"
    assert outcome.steps == (StepVerdict("", "Success", "no_change", reason),)


def test_two_ended_blocks_cannot_be_moved() -> None:
    machine = build((1, 0, 0), (9, 0, 4, 1, 5))
    assert failure(machine, "Move 2 to 0 in 1") == (
        "two_ended",
        "block 2 (Spring) is two-ended and cannot be moved; move one of its ends, as in "
        "'Move 2 end a to 0 in 4'",
    )


def test_a_task_limits_types_and_size() -> None:
    machine = build((1, 0, 0))
    assert failure(machine, "Add 2 to 0 in 3", CAGE) == (
        "type_not_allowed",
        "type 2 (Powered Wheel) is not allowed here; allowed types: 1, 15",
    )
    assert failure(machine, "Add 1 to 0 in 4", CAGE)[0] == "size_limit"
    assert apply_script(machine, "Add 15 to 0 in 4", CAGE).success


def test_extended_types_need_a_task() -> None:
    assert failure(CAR, "Add 38 to 0 in 4")[0] == "type_not_allowed"


def test_every_step_is_checked_against_the_whole_machine() -> None:
    assert failure(PUBLISHED_OVERLAP, "Remove 3")[0] == "face_occupied"
    assert apply_script(build((63, 0, 0), (49, 1, 7), (36, 1, 8)), "Remove 3").success


def test_the_result_is_valid() -> None:
    outcome = apply_script(CATAPULT, "Remove 13\nAdd 36 to 12 in 0\nMove 9 to 8 in 2")
    assert outcome.success
    assert check(outcome.machine).machine_valid
    assert outcome.id_map == {**{old: old for old in range(13)}, 13: None}
