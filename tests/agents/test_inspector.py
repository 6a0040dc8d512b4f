"""Critiques in replies."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.agents.inspector import Defect, Inspector, InspectorInput, read_defects
from tests.agents.fakes import FRAME, THROWING
from tests.agents.test_orientation import LINES

GIVEN = InspectorInput(THROWING, FRAME)
REPLY = f"""Well.
<Three-Dimensional Perception of the World>
{LINES}</Three-Dimensional Perception of the World>
<Question Answer>
1. None.
</Question Answer>
<Summary of Design Defects>
- blocks 1, 2 | structure Base | too long
- blocks 9 | structure none | no boulder
</Summary of Design Defects>"""


def test_good_reply() -> None:
    inspection = Inspector().parse(REPLY, GIVEN).output
    assert inspection is not None
    assert inspection.orientation_score == 1.0
    assert inspection.orientation["frontmost"] == [1]
    assert inspection.defects == (Defect((1, 2), "Base", "too long"), Defect((), "", "no boulder"))
    assert inspection.text == (
        "1. None.\n\nDefects:\n- blocks 1, 2 | structure Base | too long\n"
        "- blocks 9 | structure none | no boulder"
    )


def test_world_may_be_missing() -> None:
    parsed = Inspector().parse(REPLY.replace("Three-Dimensional", "Flat"), GIVEN)
    assert parsed.output is not None
    assert (parsed.output.orientation, parsed.output.orientation_score) == ({}, 0.0)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "all fine",
            "The reply has no section <Question Answer> or <Summary of Design Defects>.",
        ),
        (
            REPLY.replace("Question Answer", "Answers"),
            "The reply has no section <Question Answer>.",
        ),
    ],
)
def test_missing_sections(text: str, problem: str) -> None:
    parsed = Inspector().parse(text, GIVEN)
    assert (parsed.output, parsed.code, parsed.problem) == (None, "missing_section", problem)
    assert not parsed.parsed


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("none", ()),
        ("- None.\n", ()),
        ("---", ()),
        (
            "1. Block 3 and block 4 overlap 2 times",
            (Defect((3, 4), "", "Block 3 and block 4 overlap 2 times"),),
        ),
        ("* blocks 3, 4 and 3: weak", (Defect((3, 4), "", "blocks 3, 4 and 3: weak"),)),
        ("3; 4 | Arm | a | b", (Defect((3, 4), "Arm", "a | b"),)),
        ("unbalanced", (Defect((), "", "unbalanced"),)),
        (
            "- fatal | blocks 3 | structure Arm | a | b",
            (Defect((3,), "Arm", "a | b", "fatal"),),
        ),
        ("- **Minor** | block 3 | structure none | loose", (Defect((3,), "", "loose", "minor"),)),
        ("- likely | block 3 is weak", (Defect((3,), "", "block 3 is weak", "likely"),)),
    ],
)
def test_defects(text: str, expected: tuple[Defect, ...]) -> None:
    assert read_defects(text, 10) == expected


@given(st.text())
def test_never_raises(text: str) -> None:
    Inspector().parse(text, GIVEN)
    Inspector().parse(f"<Question Answer>{text}<Summary of Design Defects>{text}", GIVEN)
