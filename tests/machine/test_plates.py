"""Plates: numbers, faces, holes, and machines built on them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.errors import ConfigError
from agentflow.machine.blocks.library import library
from agentflow.machine.blocks.types import HOLE, HOLES, PATTERNS, SIZES, Plate, plate_of
from agentflow.machine.brief import Brief
from agentflow.machine.edits.script import apply_script
from agentflow.machine.geometry.placement import place
from agentflow.machine.tree import ROOT, Machine, Step
from agentflow.machine.validity import check

SMALL = Plate(9)
PIERCED = Plate(21, 12, 3)
GIVEN = Machine((Step(0, SMALL.type, -1, -1), Step(1, 39, 0, SMALL.face(0, -2))))
BRIEF = Brief("gears", "Turn.", (), (), (), (38, 51), given=GIVEN)

plates = st.builds(Plate, st.integers(*SIZES), st.integers(*HOLES), st.integers(*PATTERNS))


@given(plates)
def test_the_type_number_encodes_the_plate(plate: Plate) -> None:
    assert plate_of(plate.type) == plate


@pytest.mark.parametrize("number", [0, 63, 4999, 9210, 32000, -9000])
def test_other_numbers_are_not_plates(number: int) -> None:
    assert plate_of(number) is None
    assert (number in library()) == (number in (0, 63))


def test_faces_are_numbered_row_by_row_from_the_corner() -> None:
    assert (SMALL.row_length, len(SMALL.block_type().faces)) == (17, 289)
    assert [SMALL.face_position(face) for face in (0, 1, 17, 288)] == [
        (-4.0, -4.0),
        (-3.5, -4.0),
        (-4.0, -3.5),
        (4.0, 4.0),
    ]
    assert {face.direction for face in SMALL.block_type().faces} == {"Up"}
    with pytest.raises(ConfigError, match=r"^x = 4.5, z = 0 m is not on a plate 9 m wide$"):
        SMALL.face(4.5, 0)


def test_nothing_can_be_attached_over_a_hole() -> None:
    x, z = PIERCED.hole_centres[0]
    assert len(PIERCED.hole_centres) == 12
    assert len(library()[PIERCED.type].closed) == 12 * 25
    with pytest.raises(ConfigError, match=r"is over a hole of the plate$"):
        PIERCED.face(x + HOLE / 2, z)
    beside = PIERCED.face(x + HOLE / 2 + 0.5, z)
    assert beside in library()[PIERCED.type].open_faces
    closed = min(library()[PIERCED.type].closed)
    report = check(Machine((Step(0, PIERCED.type, -1, -1), Step(1, 15, 0, closed))))
    assert [problem.message for problem in report.problems] == [
        f"block 1: face {closed} of block 0 (Plate) is over a hole; nothing can be attached to it"
    ]
    assert closed not in place(Machine((Step(0, PIERCED.type, -1, -1),))).free_faces(0)


def test_only_the_plate_is_exempt_from_the_size_limit() -> None:
    wide = Plate(31)
    ends = (Step(1, 15, 0, wide.face(-9, 0)), Step(2, 15, 0, wide.face(9, 0)))
    root = Step(0, wide.type, -1, -1)
    assert check(Machine((root,))).machine_valid
    assert check(Machine((root, ends[0]))).machine_valid
    assert [problem.code for problem in check(Machine((root, *ends))).problems] == ["size_limit"]


def test_given_blocks_must_be_repeated_and_may_have_any_type() -> None:
    cog = Step(2, 38, 0, SMALL.face(0, 0))
    assert check(Machine((*GIVEN, cog)), BRIEF).task_valid
    assert check(GIVEN.to_text(), BRIEF).task_valid
    codes = {
        "root": (ROOT,),
        "moved": (GIVEN[0], Step(1, 39, 0, SMALL.face(0, 2))),
        "left out": (GIVEN[0], Step(1, 38, 0, SMALL.face(0, 0))),
    }
    for steps in codes.values():
        report = check(Machine(steps), BRIEF)
        assert report.problems[0].code == "given_altered"
        assert not report.file_valid
    second = check(Machine((*GIVEN, Step(2, 39, 0, SMALL.face(0, 0)))), BRIEF)
    assert second.problems[0].code == "type_not_allowed"
    missing = check([], BRIEF)
    assert not missing.file_valid


def test_given_blocks_cannot_be_moved_or_removed() -> None:
    for command, done in (("Remove 1", "removed"), (f"Move 1 to 0 in {SMALL.face(2, 2)}", "moved")):
        outcome = apply_script(GIVEN, command, BRIEF)
        assert (outcome.steps[0].code, outcome.steps[0].reason) == (
            "given_altered",
            f"block 1 is given and cannot be {done}",
        )
    added = apply_script(GIVEN, f"Add 38 to 0 in {SMALL.face(0, 0)}", BRIEF)
    assert added.success


def test_overlaps_on_a_plate_are_reported_briefly() -> None:
    twins = (*GIVEN, Step(2, 38, 0, SMALL.face(0, -1)))
    (problem,) = check(Machine(twins), BRIEF).problems
    assert problem.message.startswith("block 2 (Medium Cog) and block 1 (Powered Cog) overlap by")
    assert problem.message.endswith("and 263 more")


@pytest.mark.parametrize(("free", "end"), [(24, "all"), (25, "all and 1 more")])
def test_at_most_24_free_faces_are_listed(free: int, end: str) -> None:
    tiny = Plate(5, 1)
    brief = replace(BRIEF, given=Machine((Step(0, tiny.type, -1, -1),)))
    faces = library()[tiny.type].open_faces
    cogs = (Step(i, 38, 0, face) for i, face in enumerate(faces[free:], start=1))
    problem = check(Machine((*brief.given, *cogs)), brief).problems[0]
    listed = problem.message.partition("free faces of block 0: ")[2]
    assert listed.replace(", ".join(map(str, faces[:24])), "all") == end
