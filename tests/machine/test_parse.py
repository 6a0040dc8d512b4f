import json

import pytest

from agentflow.machine import ROOT, Machine, Step, read_machine
from agentflow.machine.formats.parse import MAX_BLOCKS
from tests.machine.builders import CATAPULT

START = {"type": 0, "id": 0, "parent": -1, "face_id": -1}


def block(index: int, **changes: object) -> dict[str, object]:
    return {"type": 15, "id": index, "parent": 0, "face_id": index, **changes}


def codes(source: object) -> list[tuple[str, tuple[int, ...], str]]:
    reading = read_machine(source)
    assert reading.machine is None
    return [(problem.code, problem.blocks, problem.message) for problem in reading.problems]


def test_a_bare_root_is_a_machine() -> None:
    assert read_machine([START]).machine == Machine((ROOT,))


def test_text_and_data_are_read_alike() -> None:
    assert read_machine(CATAPULT.to_json()).machine == CATAPULT
    assert read_machine(CATAPULT.to_text()).machine == CATAPULT
    reply = f"My design [v2]:\n```json\n{CATAPULT.to_text()}\n```\nIt throws."
    reading = read_machine(reply)
    assert (reading.machine, reading.repaired, reading.notes) == (CATAPULT, False, ())


def test_a_repaired_machine_says_so() -> None:
    text = CATAPULT.to_text().replace('"', "'").replace("},", "}, // next").replace("]", ",]")
    reading = read_machine(text)
    assert (reading.machine, reading.repaired) == (CATAPULT, True)


def test_the_last_fence_with_blocks_wins() -> None:
    reply = f"```json\n{CATAPULT.to_text()}\n```\nThe arm is [11, 12]:\n```json\n[11, 12]\n```"
    assert read_machine(reply).machine == CATAPULT


def test_numbers_as_strings_and_extra_keys_are_noted() -> None:
    reading = read_machine([START, block(1, parent="0", face_id=" 1 ", name="arm")])
    assert reading.machine == Machine((ROOT, Step(1, 15, 0, 1)))
    assert reading.notes == (
        "block 1: parent is the string '0', read as a number",
        "block 1: face_id is the string ' 1 ', read as a number",
        "block 1: ignored 'name'",
    )
    assert not reading.repaired


def test_two_ended_blocks() -> None:
    spring = {"type": 9, "id": 2, "parent_a": 0, "face_id_a": 1, "parent_b": "1", "face_id_b": 0}
    reading = read_machine([START, block(1), spring])
    assert reading.machine is not None
    assert reading.machine[2] == Step(2, 9, 0, 1, 1, 0)


@pytest.mark.parametrize(
    ("source", "told"),
    [
        (
            "I cannot.",
            "not_json: no JSON list found; write the whole machine as a JSON list of objects like "
            '{"type": 1, "id": 1, "parent": 0, "face_id": 4}',
        ),
        (
            {"machine": []},
            "not_a_list: the machine is {'machine': []}; write it as a JSON list of objects like "
            '{"type": 1, "id": 1, "parent": 0, "face_id": 4}',
        ),
        (
            [],
            "empty: the machine is an empty list; write it as a JSON list of objects like "
            '{"type": 1, "id": 1, "parent": 0, "face_id": 4}',
        ),
        (
            [START, 5],
            "not_an_object at 1: item 1 of the machine's list is 5; expected an object with type, "
            "id, parent, face_id",
        ),
        ([START, {"type": 1}], "missing_field at 1: block 1 has no 'id'"),
        (
            [START, block(1, parent=0.0)],
            "not_a_number at 1: block 1: parent is 0.0, expected a whole number",
        ),
        (
            [START, block(1, parent=False)],
            "not_a_number at 1: block 1: parent is False, expected a whole number",
        ),
        (
            [START, block(1, face_id=float("nan"))],
            "not_a_number at 1: block 1: face_id is nan, expected a whole number",
        ),
        (
            [START, block(1, face_id=None)],
            "not_a_number at 1: block 1: face_id is None, expected a whole number",
        ),
        (
            [START, block(1, face_id="٣")],
            "not_a_number at 1: block 1: face_id is '٣', expected a whole number",
        ),
        (
            [START, block(1), block(3)],
            "id_sequence at 2: item 2 of the list has id 3; ids are 0, 1, 2, ... in list order, "
            "so it must be 2",
        ),
        (
            [START, block(1), block(1, face_id=2)],
            "id_sequence at 2: item 2 of the list has id 1; ids are 0, 1, 2, ... in list order, "
            "so it must be 2",
        ),
        (
            [{**START, "type": 1}],
            "root at 0: the first block must be the Starting Block: type 0, id 0, parent -1, "
            "face_id -1",
        ),
        (
            [START, block(1, type=0)],
            "starting_block at 1: block 1: type 0 is the Starting Block; only the first block may "
            "have it",
        ),
        (
            [START, block(1, type=64)],
            "unknown_type at 1: block 1: type 64 is unknown; the nearest types are 63 (Log), 60 "
            "(Large Unpowered Wheel), 56 (Water Cannon)",
        ),
        (
            [START, block(1, type=10**30)],
            "unknown_type at 1: block 1: type a very large number is unknown; the nearest types "
            "are 87 (Elastic Pad), 86 (Roller Wheel), 76 (Axle Connector)",
        ),
        (
            [START, block(1, parent=7)],
            "parent_not_found at 1: block 1: parent 7 does not exist; the blocks are 0 to 1",
        ),
        (
            [START, block(1, parent=-1)],
            "parent_not_found at 1: block 1: parent -1 does not exist; the blocks are 0 to 1",
        ),
        (
            [START, block(1, parent=2), block(2)],
            "parent_not_earlier at 1: block 1: parent 2 does not come before block 1",
        ),
        (
            [START, block(1, face_id=6)],
            "face_not_found at 1: block 1: block 0 (Starting Block) has no face 6; its faces are "
            "0 to 5",
        ),
        (
            [START, block(1, face_id=-1)],
            "face_not_found at 1: block 1: block 0 (Starting Block) has no face -1; its faces are "
            "0 to 5",
        ),
        (
            [START, block(1, type=2), block(2, parent=1, face_id=3)],
            "face_not_found at 2: block 2: block 1 (Powered Wheel) has no face 3; its only face "
            "is 0",
        ),
        (
            [START, block(1, type=36), block(2, parent=1, face_id=0)],
            "face_not_found at 2: block 2: block 1 (Boulder) has no faces; nothing can be "
            "attached to it",
        ),
        (
            [START, block(1, type=7)],
            "two_ended at 1: block 1: type 7 (Brace) is two-ended; give two parents, each with a "
            "face",
        ),
        (
            [
                START,
                {"type": 1, "id": 1, "parent_a": 0, "face_id_a": 0, "parent_b": 0, "face_id_b": 1},
            ],
            "two_ended at 1: block 1: type 1 (Wooden Block) is not two-ended; give one parent and "
            "one face",
        ),
    ],
)
def test_file_problems(source: object, told: str) -> None:
    code, blocks, message = codes(source)[0]
    assert "".join([code, *(f" at {block}" for block in blocks), ": ", message]) == told


def test_all_problems_are_reported() -> None:
    source = [START, block(1, type=99), block(5, parent=9), "x", block(4, face_id="q")]
    assert [(code, blocks) for code, blocks, _ in codes(source)] == [
        ("unknown_type", (1,)),
        ("id_sequence", (2,)),
        ("parent_not_found", (2,)),
        ("not_an_object", (3,)),
        ("not_a_number", (4,)),
    ]


def test_extended_types_need_a_task_that_lists_them() -> None:
    source = [START, block(1, type=38)]
    (code, blocks, message) = codes(source)[0]
    assert (code, blocks) == ("type_not_allowed", (1,))
    assert message.startswith("block 1: type 38 (Medium Cog) is not allowed here; allowed types: 1")
    assert read_machine(source, blocks=(0, 38)).machine is not None
    assert read_machine([START, block(1)], blocks=(38,)).problems[0].message == (
        "block 1: type 15 (Small Wooden Block) is not allowed here; allowed types: 38"
    )


def test_too_many_blocks_are_refused() -> None:
    source = [START] + [block(index) for index in range(1, MAX_BLOCKS + 1)]
    assert codes(json.dumps(source)) == [
        ("too_many_blocks", (), f"the machine has {MAX_BLOCKS + 1} blocks; the maximum is 800")
    ]


@pytest.mark.parametrize(
    "text", ["[" * 5000 + "]" * 5000, "[1" + "0" * 5000 + "]", "[NaN]", "[1e999]"]
)
def test_json_bombs_are_problems(text: str) -> None:
    assert read_machine(text).problems
