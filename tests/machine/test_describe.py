import re

import pytest

from agentflow.machine import Machine, apply_script, describe, describe_text
from agentflow.machine.description.geometry_info import list_text
from agentflow.machine.description.rounding import one_decimal
from tests.machine.builders import CATAPULT, build

SPRUNG = build((1, 0, 0), (22, 1, 6), (9, 0, 4, 1, 5), (45, 2, 0, 2, 0), (36, 2, 0))
LOGS = build(
    *[(63, 0, face) for face in range(6)],
    *[(63, parent, face) for parent in (1, 2, 3, 4) for face in (2, 5)],
    *[(63, 1, 0), (63, 2, 0), (63, 3, 0), (63, 4, 0), (63, 1, 8)],
)
WAGON = apply_script(
    CATAPULT,
    "\n".join(
        (
            "Add 9 to 4 in 3 to 5 in 2",
            "Add 35 to 3 in 0",
            "Add 40 to 10 in 0",
            "Add 7 to 0 in 1 to 8 in 7",
            "Add 15 to 7 in 3",
            "Add 15 to 5 in 5",
        )
    ),
).machine


def tokens(text: str) -> int:
    """Upper bound on the number of tokens: one per word, three digits, or punctuation mark."""
    return len(re.findall(r"[0-9]{1,3}| ?[A-Za-z]+| ?[^\sA-Za-z0-9]|\n", text))


@pytest.mark.parametrize(
    ("value", "scale", "shown"),
    [(1, 20, 0.1), (3, 20, 0.2), (-1, 20, -0.1), (-3, 20, -0.2), (2, 20, 0.1), (149, 20, 7.5)],
)
def test_halves_are_rounded_away_from_zero(value: int, scale: int, shown: float) -> None:
    assert one_decimal(value, scale) == shown


def blocks(machine: Machine) -> list[dict[str, object]]:
    description = describe(machine)["blocks"]
    assert isinstance(description, list)
    return description


def test_a_block_as_data() -> None:
    assert blocks(build((1, 0, 3), (2, 1, 3)))[1:] == [
        {
            "id": 1,
            "name": "Wooden Block",
            "type": 1,
            "parent": {"id": 0, "face_id": 3, "direction": "Right"},
            "children": [{"face_id": 3, "id": 2}],
            "center": [1.5, 1.0, 0.0],
            "position": [0.5, 1.0, 0.0],
            "facing": "x+",
            "on_ground": False,
            "free_faces": [
                {"face_id": 0, "position": [2.5, 1.0, 0.0], "facing": "x+"},
                {"face_id": 1, "position": [1.0, 1.0, 0.5], "facing": "z+"},
                {"face_id": 2, "position": [2.0, 1.0, 0.5], "facing": "z+"},
                {"face_id": 4, "position": [2.0, 1.0, -0.5], "facing": "z-"},
                {"face_id": 5, "position": [1.0, 1.5, 0.0], "facing": "y+"},
                {"face_id": 6, "position": [2.0, 1.5, 0.0], "facing": "y+"},
                {"face_id": 7, "position": [1.0, 0.5, 0.0], "facing": "y-"},
                {"face_id": 8, "position": [2.0, 0.5, 0.0], "facing": "y-"},
            ],
        },
        {
            "id": 2,
            "name": "Powered Wheel",
            "type": 2,
            "parent": {"id": 1, "face_id": 3, "direction": "Right"},
            "children": [],
            "center": [1.0, 1.0, -0.8],
            "position": [1.0, 1.0, -0.5],
            "facing": "z-",
            "on_ground": True,
            "free_faces": [{"face_id": 0, "position": [1.0, 1.0, -1.0], "facing": "z-"}],
        },
    ]


def test_the_machine_as_data() -> None:
    description = describe(SPRUNG)
    del description["blocks"]
    assert description == {
        "size": [1.9, 3.9, 3.45],
        "mass": 7.65,
        "centre_of_mass": [0.0, 2.4, 1.8],
        "support_polygon": [[-0.5, -0.5], [0.5, -0.5], [0.5, 2.5], [-0.5, 2.5]],
        "stands": True,
        "drives": [],
        "pulls": [
            {
                "id": 3,
                "from_block": 0,
                "to_block": 1,
                "direction": [0.0, 0.0, 1.0],
                "length": 1.0,
            },
            {"id": 4, "from_block": 2, "to_block": 2, "direction": None, "length": 0.0},
        ],
        "auto_connections": [],
    }
    assert blocks(SPRUNG)[3] == {
        "id": 3,
        "name": "Spring",
        "type": 9,
        "parents": [
            {"id": 0, "face_id": 4, "direction": "Up"},
            {"id": 1, "face_id": 5, "direction": "Up"},
        ],
        "end_a": [0.0, 1.0, 0.0],
        "end_b": [0.0, 1.0, 1.0],
        "length": 1.0,
    }


def test_pulls_have_two_decimals() -> None:
    description = describe(build((1, 0, 4), (9, 0, 0, 1, 0)))["pulls"]
    assert description == [
        {"id": 2, "from_block": 0, "to_block": 1, "direction": [0.0, 0.98, -0.2], "length": 2.5}
    ]


@pytest.mark.parametrize(
    ("kind", "face", "drives"),
    [
        (2, 3, "z+"),
        (2, 2, "z+"),
        (2, 0, "x-"),
        (2, 1, "x+"),
        (46, 3, "z+"),
        (46, 0, "x-"),
        (2, 5, None),
    ],
)
def test_wheels_on_the_ground_drive(kind: int, face: int, drives: str | None) -> None:
    assert describe(build((kind, 0, face)))["drives"] == [{"id": 1, "direction": drives}]


def test_wheels_in_the_air_and_free_wheels_do_not_drive() -> None:
    assert describe(build((2, 0, 4)))["drives"] == []
    assert describe(build((40, 0, 3)))["drives"] == []


def test_closed_loops_are_described() -> None:
    bridge = build((1, 0, 2), (1, 0, 3), (1, 1, 6), (1, 2, 6), (63, 3, 4))
    assert describe(bridge)["auto_connections"] == [
        {"block": 5, "face_id": 0, "partner": 4, "partner_face": 2}
    ]
    assert "\nFaces joined by touching: 5.0 with 4.2.\n" in describe_text(bridge)


def test_the_text() -> None:
    assert describe_text(build((1, 0, 3), (2, 1, 3), (9, 0, 0, 1, 0))) == "\n".join(
        (
            "x, y, z in m, y from the lowest corner. 'on 4.2 Left': on block 4, face 2, which is "
            "a Left face. Free faces, except on the ground: facing, ids (position). a/b: one "
            "value each; 1-4, a..b: in even steps.",
            "Size (3,2,1.5), mass 2.15 kg, centre of mass (1,1,-0.3), NOT over the support "
            "polygon (x,z) (1,-1) (1,-0.5).",
            "Powered wheels on the ground drive the machine: 2 to x+.",
            "0 Starting Block: faces z+, centre (0,1,0), free z+ 0 (0,1,0.5); z- 1 (0,1,-0.5); "
            "x- 2 (-0.5,1,0); y+ 4 (0,1.5,0); y- 5 (0,0.5,0)",
            "1 Wooden Block: on 0.3 Right, faces x+, centre (1.5,1,0), free x+ 0 (2.5,1,0); "
            "z+ 1-2 (1/2,1,0.5); z- 4 (2,1,-0.5); y+ 5-6 (1/2,1.5,0); y- 7-8 (1/2,0.5,0)",
            "2 Powered Wheel: on 1.3 Right, faces z-, centre (1,1,-0.8), building point "
            "(1,1,-0.5), on ground, free z- 0 (1,1,-1)",
            "3 Spring: from 0.0 to 1.0, (0,1,0.5) to (2.5,1,0), length 2.5",
        )
    )


def test_the_short_text() -> None:
    assert describe_text(build((1, 0, 3), (2, 1, 3)), short=True) == "\n".join(
        (
            "x, y, z in m, y from the lowest corner. 'on 4.2 Left': on block 4, face 2, which is "
            "a Left face. Free faces, except on the ground: ids. a/b: one value each.",
            "Size (3,2,1.5), mass 1.75 kg, centre of mass (1,1,-0.4), NOT over the support "
            "polygon.",
            "Powered wheels on the ground drive the machine: 2 to x+.",
            "0 Starting Block: faces z+, centre (0,1,0), free 0-2 4-5",
            "1 Wooden Block: on 0.3 Right, faces x+, centre (1.5,1,0), free 0-2 4-8",
            "2 Powered Wheel: on 1.3 Right, faces z-, centre (1,1,-0.8), on ground, free 0",
        )
    )


@pytest.mark.parametrize("machine", [LOGS, WAGON])
def test_twenty_blocks_stay_within_the_token_limits(machine: Machine) -> None:
    assert len(machine) == 20
    for short, limit in ((False, 3000), (True, 1200)):
        text = describe_text(machine, short=short)
        assert tokens(text) < limit
        assert len(text) / 3.3 < limit


def test_two_ended_blocks_between_the_same_blocks_share_a_line() -> None:
    ends = ((9, 0, 4, 1, 6), (9, 0, 2, 1, 2), (7, 0, 4, 1, 6), (9, 0, 4, 1, 5))
    text = describe_text(build((1, 0, 0), *ends))
    assert text.splitlines()[-2:] == [
        "2/3/5 Spring: from 0.4/2/4 to 1.6/2/5, (0/-0.5/0,1/0.5/1,0) to "
        "(0/-0.5/0,1/0.5/1,2/2/1), length 2/2/1",
        "4 Brace: from 0.4 to 1.6, (0,1,0) to (0,1,2), length 2",
    ]


def test_faces_on_the_ground_are_not_listed_as_free() -> None:
    assert "y-" not in describe_text(build((63, 0, 0)))
    assert "free y- 0 (0,0,0)" not in describe_text(build((63, 0, 5)))
    assert "; y- 10-12 (0,3,1..3)" in describe_text(build((63, 0, 5), (63, 0, 0)))


def test_the_list_without_geometry() -> None:
    assert list_text(build((1, 0, 3), (2, 1, 3), (9, 0, 0, 1, 0))).splitlines() == [
        "'on 4.2 Left': on block 4, face 2, which is a Left face.",
        "0 Starting Block: faces z+",
        "1 Wooden Block: on 0.3 Right",
        "2 Powered Wheel: on 1.3 Right",
        "3 Spring: from 0.0 to 1.0, length 2.5",
    ]
