"""The inspector's bearings against the true geometry."""

from __future__ import annotations

import pytest

from agentflow.agents.inspector import extreme_blocks, orientation_score, read_orientation
from agentflow.machine.geometry.placement import place
from tests.agents.fakes import FRAME, THROWER

LINES = """x+: right
y+: up
z+: forward
frontmost: 1
rearmost: 2
leftmost: 0
rightmost: 1
topmost: 2
lowest: 0
"""


def test_extremes_list_all_ties() -> None:
    assert extreme_blocks(place(FRAME)) == {
        "frontmost": (1,),
        "rearmost": (2,),
        "leftmost": (0, 1, 2),
        "rightmost": (0, 1, 2),
        "topmost": (0, 1, 2),
        "lowest": (0, 1, 2),
    }


def test_extremes_of_a_thrower() -> None:
    assert extreme_blocks(place(THROWER))["topmost"] == (6,)


def test_all_right() -> None:
    assert orientation_score(read_orientation(LINES), place(FRAME)) == 1.0


def test_each_question_counts_a_ninth() -> None:
    wrong = LINES.replace("frontmost: 1", "frontmost: 2").replace("x+: right", "x+: left")
    assert orientation_score(read_orientation(wrong), place(FRAME)) == pytest.approx(7 / 9)
    assert orientation_score({}, place(FRAME)) == 0.0


def test_one_wrong_block_among_several_is_wrong() -> None:
    assert orientation_score({"leftmost": [0, 1]}, place(FRAME)) == pytest.approx(1 / 9)
    assert orientation_score({"frontmost": [1, 2]}, place(FRAME)) == 0.0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", {}),
        ("- **X+**: points to the Right, not left", {"x+": "right"}),
        ("z+ = Front", {"z+": "forward"}),
        ("frontmost: block 4 (Wooden Block, type 1)", {"frontmost": [4]}),
        ("Frontmost: 4, 7 and 9 with 3 ties", {"frontmost": [4, 7, 9]}),
        ("frontmost:\nrearmost: 2", {"rearmost": [2]}),
        ("lowest: 1\nlowest: 2", {"lowest": [1]}),
        (
            '{"y+": "up", "topmost": [3, 4], "lowest":[\n 5]}',
            {"y+": "up", "topmost": [3, 4], "lowest": [5]},
        ),
        ("x+: dunno", {}),
    ],
)
def test_answers(text: str, expected: dict[str, object]) -> None:
    assert read_orientation(text) == expected
