import json
import math

import pytest
from hypothesis import given

from agentflow.machine import Machine, check, library
from agentflow.machine.formats.connect import facing_of
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates
from agentflow.machine.geometry.pose import FACINGS
from tests.machine.builders import CAR, CATAPULT, PUBLISHED_OVERLAP, build
from tests.machine.strategies import machines
from tests.timing import assert_linear

S = 0.5**0.5
ROOT = {"type": 0, "Position": [0, 0, 0], "Rotation": [0, 0, 0, 1]}
LOG = {"type": 63, "Position": [0.5, 0, 0], "Rotation": [0, S, 0, S]}
"""On the Right face of the root."""


def found(*items: object) -> list[tuple[str, tuple[int, ...], str]]:
    return [
        (problem.code, problem.blocks, problem.message)
        for problem in check(read_coordinates([ROOT, *items])).problems
    ]


def test_a_machine_in_coordinates() -> None:
    assert to_coordinates(build((63, 0, 3), (9, 0, 4, 1, 0))) == [
        {"type": 0, "Position": [0, 0, 0], "Rotation": [0, 0, 0, 1]},
        {"type": 63, "Position": [0.5, 0, 0], "Rotation": [0, S, 0, S]},
        {
            "type": 9,
            "Position": [0, 0.5, 0],
            "Rotation": [0, 0, 0, 1],
            "end-position": [3.5, 0, 0],
        },
    ]


@pytest.mark.parametrize("machine", [CAR, CATAPULT, build((1, 0, 4), (7, 1, 1, 0, 0))])
def test_round_trip(machine: Machine) -> None:
    located = read_coordinates(json.dumps(to_coordinates(machine)))
    assert (located.machine, located.problems, located.loose, located.notes) == (
        machine,
        (),
        (),
        (),
    )
    assert check(located) == check(machine)


@given(machines())
def test_round_trip_is_exact_or_reports_ambiguous_parents(machine: Machine) -> None:
    located = read_coordinates(to_coordinates(machine))
    assert (located.problems, located.loose) == ((), ())
    assert located.machine == machine or any("ambiguous" in note for note in located.notes)


def test_the_published_overlap_example_in_coordinates() -> None:
    assert check(read_coordinates(to_coordinates(PUBLISHED_OVERLAP))).overlaps == ((4, 7), (5, 6))


def test_the_root_may_be_anywhere() -> None:
    moved = [
        {**item, "Position": [part + 5 for part in item["Position"]]}  # type: ignore[attr-defined]
        for item in to_coordinates(CATAPULT)
    ]
    assert read_coordinates(moved).machine == CATAPULT


def test_positions_snap_to_faces_within_a_tenth_of_a_metre() -> None:
    near = {**LOG, "Position": [0.56, 0.05, -0.06]}
    assert read_coordinates([ROOT, near]).machine == build((63, 0, 3))
    assert found({**LOG, "Position": [0.6, 0, 0]}) == []
    assert found({**LOG, "Position": [0.5, 0.11, 0]}) == [
        (
            "no_parent",
            (1,),
            "block 1 (Log) has no parent at (0.5, 0.11, 0): no earlier block has a face within "
            "0.1 m that faces x+; the nearest such face is 3 of block 0 (Starting Block) at "
            "(0.5, 0, 0)",
        )
    ]


def test_a_parent_must_be_earlier() -> None:
    items = to_coordinates(build((63, 0, 3), (15, 1, 0)))
    report = check(read_coordinates([items[0], items[2], items[1]]))
    assert (report.file_valid, report.spatial_valid) == (True, False)
    assert [(problem.code, problem.blocks) for problem in report.problems] == [("no_parent", (1,))]
    assert (report.machine, report.size) == (None, (4.0, 1.0, 1.0))


@pytest.mark.parametrize("name", FACINGS)
def test_rotations_have_a_tolerance_of_one_degree(name: str) -> None:
    x, y, z, w = FACINGS[name].quaternion
    assert facing_of((-2 * x, -2 * y, -2 * z, -2 * w)) == name

    def turned(degrees: float) -> tuple[float, float, float, float]:
        s, c = math.sin(math.radians(degrees) / 2), math.cos(math.radians(degrees) / 2)
        return (x * c + w * s, y * c + z * s, z * c - y * s, w * c - x * s)

    assert facing_of(turned(0.99)) == name
    assert facing_of(turned(1.01)) is None


def test_other_rotations_are_refused() -> None:
    assert found({**LOG, "Rotation": [0, 0, S, S]}) == [
        (
            "rotation",
            (1,),
            "block 1 (Log) has rotation 0, 0, 0.707107, 0.707107, which is not within 1 "
            "degree of any of the six orientations",
        )
    ]
    assert found({**LOG, "Rotation": [0, 0, 0, 0]})[0][0] == "rotation"
    turned_root = [{**ROOT, "Rotation": [0, 1, 0, 0]}, LOG]
    assert [problem.message for problem in check(read_coordinates(turned_root)).problems] == [
        "block 0 (Starting Block) is rotated; its rotation must be 0, 0, 0, 1"
    ]


def test_unattached_blocks_are_reported_with_overlaps() -> None:
    small = {"type": 15, "Position": [0.5, 0, 0], "Rotation": [0, S, 0, S]}
    lost = {"type": 15, "Position": [9, 9, 9], "Rotation": [0, 0, 0, 1]}
    report = check(read_coordinates([ROOT, LOG, lost, small]))
    assert [(problem.code, problem.blocks) for problem in report.problems] == [
        ("no_parent", (2,)),
        ("face_occupied", (1, 3)),
        ("overlap", (1, 3)),
    ]
    assert report.overlaps == ((1, 3),)


def test_ambiguous_parents_are_noted() -> None:
    # a ring of blocks comes back to the root: its Left face meets that of block 3
    machine = build((15, 0, 0), (15, 1, 1), (15, 2, 1), (7, 0, 2, 3, 1))
    located = read_coordinates(to_coordinates(machine))
    assert located.machine is not None
    assert located.machine[4].parents == (0, 0)
    assert located.notes == (
        "block 4 (Brace) has an ambiguous parent: block 0 face 2 was chosen, "
        "but block 3 face 1 is equally near",
        "block 4 (Brace) has an ambiguous parent: block 0 face 2 was chosen, "
        "but block 3 face 1 is equally near",
    )


WRONG = [
    ("nothing", "not_json", "no JSON list found; write the whole machine as "),
    ({}, "not_a_list", "the machine is {}; write it as "),
    ([], "empty", "the machine is an empty list; write it as "),
    ([LOG], "root", "block 0: the first block must be the Starting Block, type 0"),
    (
        [ROOT, 5],
        "not_an_object",
        "item 1 of the machine's list is 5; expected an object with type, ",
    ),
    ([ROOT, {**LOG, "type": 64}], "unknown_type", "block 1: type 64 is unknown; the nearest "),
    ([ROOT, {**LOG, "type": 26}], "type_not_allowed", "block 1: type 26 (Propeller) is not all"),
    (
        [ROOT, ROOT],
        "starting_block",
        "block 1: type 0 is the Starting Block; only the first block may have it",
    ),
    ([ROOT, {"type": 1}], "missing_field", "block 1 has no 'Position'"),
    (
        [ROOT, {**LOG, "Position": [0, 1]}],
        "not_a_number",
        "block 1: Position is [0, 1], expected a list of 3 numbers",
    ),
    ([ROOT, {**LOG, "Rotation": "x"}], "not_a_number", "block 1: Rotation is 'x', expected "),
    ([ROOT, {**LOG, "Position": [0, 0, 1e400]}], "not_a_number", "block 1: Position is [0, 0, i"),
    ([ROOT, {**LOG, "Position": [0, 0, True]}], "not_a_number", "block 1: Position is [0, 0, T"),
    ([ROOT, {**LOG, "type": 7}], "missing_field", "block 1 has no 'end-position'"),
]


@pytest.mark.parametrize(("source", "code", "message"), WRONG, ids=[row[1] for row in WRONG])
def test_file_invalid_coordinates(source: object, code: str, message: str) -> None:
    report = check(read_coordinates(source))
    assert (report.file_valid, report.spatial_valid, report.machine) == (False, None, None)
    assert report.problems[0].code == code
    assert report.problems[0].message.startswith(message)


def test_strings_and_extra_keys_are_noted() -> None:
    item = {"type": "63", "Position": ["0.5", 0, 0], "Rotation": LOG["Rotation"], "name": "log"}
    located = read_coordinates([ROOT, item])
    assert located.machine == build((63, 0, 3))
    assert located.notes == (
        "block 1: type is the string '63', read as a number",
        "block 1: Position contains strings, read as numbers",
        "block 1: ignored 'name'",
    )


def test_extended_types_are_read_where_they_are_allowed() -> None:
    machine = build((39, 0, 0), (45, 0, 2, 0, 3), (26, 0, 4))
    assert read_coordinates(to_coordinates(machine), tuple(library())).machine == machine


def half_attached(logs: int) -> list[object]:
    """A row of logs on a root, and as many blocks without the root that touch nothing."""
    row = to_coordinates(build(*[(63, i, 0) for i in range(logs)]))
    lost = [{"type": 63, "Position": [9, 9, i], "Rotation": [0, 0, 0, 1]} for i in range(logs - 1)]
    return [*row, *lost]


def test_hundreds_of_unattached_blocks_take_linear_time() -> None:
    assert_linear(read_coordinates, half_attached, 400)
    located = read_coordinates(half_attached(400))
    assert (len(located.blocks), len(located.loose)) == (401, 399)
    assert "nearest" in located.loose[0].message
    assert "nearest" not in located.loose[-1].message
