"""Designs in replies: they extend what is given, and are valid."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from agentflow.agents.designer import Designer, DesignerInput, extract_rationale
from agentflow.agents.replies import machine_items
from agentflow.machine.tree import Machine
from tests.agents.fakes import FRAME, MOVEMENT, PLAN, THROWER, THROWING, fenced, machine

BASE = DesignerInput(THROWING, PLAN, "Base")
ARM = DesignerInput(THROWING, PLAN, "Arm", FRAME, last=True)
WHOLE = DesignerInput(MOVEMENT)


def _with(*steps: tuple[int, int, int]) -> Machine:
    """FRAME and further blocks."""
    return machine((1, 0, 0), (1, 0, 1), *steps)


def test_first_structure() -> None:
    parsed = Designer().parse(fenced(FRAME), BASE)
    assert parsed.output is not None
    assert (parsed.output.machine, parsed.output.rationale) == (FRAME, "Because.")
    assert parsed.spatial is True


def test_last_structure() -> None:
    full = _with((22, 0, 4), (30, 3, 0), (36, 4, 0))
    parsed = Designer().parse(fenced(full), ARM)
    assert parsed.output is not None
    assert parsed.output.machine == full


def test_whole_machine() -> None:
    assert Designer().parse(fenced(FRAME), WHOLE).output is not None


def test_last_machine_counts() -> None:
    parsed = Designer().parse(fenced(_with((15, 0, 4)), FRAME) + "[1]", BASE)
    assert parsed.output is not None
    assert parsed.output.machine == FRAME
    assert parsed.output.rationale == "Because.\n\nBecause.\n\n[1]"


def test_repaired() -> None:
    text = fenced(FRAME).replace('"', "'")
    assert Designer().parse(text, BASE).repaired


@pytest.mark.parametrize(
    ("design", "given", "code", "problem"),
    [
        (
            machine((15, 0, 0), (1, 0, 1), (22, 0, 4)),
            ARM,
            "given_altered",
            'Block 1 of the current machine, {"type": 1, "id": 1, "parent": 0, "face_id": 0}, was '
            'changed to {"type": 15, "id": 1, "parent": 0, "face_id": 0}. Send only the new '
            "steps, with ids from 3 on.",
        ),
        (
            machine((1, 0, 0)),
            ARM,
            "given_altered",
            'Block 2 of the current machine, {"type": 1, "id": 2, "parent": 0, "face_id": 1}, was '
            "left out. Send only the new steps, with ids from 3 on.",
        ),
        (FRAME, ARM, "nothing_added", "The machine has no new block. Append at least one."),
        (
            _with((15, 0, 4)),
            ARM,
            "type_outside_structure",
            "Block 3 is of type 15, which structure 'Arm' does not allow; allowed: 22, 30, 36.",
        ),
        (
            machine((22, 0, 4)),
            BASE,
            "type_outside_structure",
            "Block 1 is of type 22, which structure 'Base' does not allow; allowed: 1, 15.",
        ),
        (
            _with((36, 0, 4), (36, 0, 5)),
            replace(ARM, last=False),
            "required_count",
            "The machine has 2 blocks of type 36; the task requires exactly 1.",
        ),
    ],
)
def test_problems(design: Machine, given: DesignerInput, code: str, problem: str) -> None:
    parsed = Designer().parse(fenced(design), given)
    assert (parsed.output, parsed.code, parsed.problem) == (None, code, problem)
    assert parsed.parsed


def test_incomplete_only_matters_at_the_end() -> None:
    arm = _with((22, 0, 4))
    assert Designer().parse(fenced(arm), replace(ARM, last=False)).output is not None
    parsed = Designer().parse(fenced(arm), ARM)
    assert parsed.code == "required_count"
    assert parsed.problem.startswith("The machine is not valid:\n- ")


def test_overlap() -> None:
    parsed = Designer().parse(fenced(machine((1, 0, 0), (15, 1, 1), (15, 0, 2), (1, 3, 2))), BASE)
    assert (parsed.output, parsed.code, parsed.spatial) == (None, "overlap", False)


def test_file_problems() -> None:
    parsed = Designer().parse('```json\n[{"type": 0}]\n```', BASE)
    assert not parsed.parsed
    assert parsed.spatial is None
    assert parsed.problem.startswith("The reply contains no valid machine:\n- ")


@pytest.mark.parametrize("text", ["", "I cannot.", "```json\n{}\n```", "[" * 1000, "\ud800"])
def test_no_machine(text: str) -> None:
    parsed = Designer().parse(text, BASE)
    assert parsed.output is None
    assert not parsed.parsed
    assert parsed.problem


def test_rationale_is_what_is_outside_fences() -> None:
    assert extract_rationale("a\n```json\n[]\n```\nb\n  ```\nopen") == "a\n\nb"
    assert len(extract_rationale("x" * 10_000)) == 4000


def test_thrower_is_a_whole_machine() -> None:
    assert Designer().parse(fenced(THROWER), DesignerInput(THROWING)).output is not None


def test_new_steps_alone_are_added_to_the_current_machine() -> None:
    arm = _with((22, 0, 4), (30, 3, 0), (36, 4, 0))
    steps = arm.to_json()[len(ARM.machine or ()) :]
    parsed = Designer().parse(f"Arm.\n```json\n{json.dumps(steps)}\n```", ARM)
    assert parsed.output is not None, parsed.problem
    assert (parsed.output.machine, parsed.output.rationale) == (arm, "Arm.")
    damaged = json.dumps(steps).replace('"type"', "type", 1)
    parsed = Designer().parse(f"```json\n{damaged}\n```", ARM)
    assert parsed.repaired
    assert parsed.output is not None


def test_new_blocks_alone_are_added_in_coordinates() -> None:
    given = replace(ARM, representation="coordinates")
    arm = _with((22, 0, 4), (30, 3, 0), (36, 4, 0))
    items = machine_items(arm, "coordinates")[len(ARM.machine or ()) :]
    parsed = Designer().parse(f"```json\n{json.dumps(items)}\n```", given)
    assert parsed.output is not None, parsed.problem
    assert parsed.output.machine == arm


def test_new_steps_with_other_ids_say_which_ids_are_expected() -> None:
    steps = [{"type": 22, "id": 1, "parent": 0, "face_id": 4}]
    parsed = Designer().parse(f"```json\n{json.dumps(steps)}\n```", ARM)
    assert parsed.code == "id_sequence"
    assert "item 3 of the list has id 1;" in parsed.problem
