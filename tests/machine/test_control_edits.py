"""Edits of control programs."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings

from agentflow.machine import Brief, Machine, apply_script, describe, describe_text
from agentflow.machine.brief import Limits
from agentflow.machine.controls import MAX_CONTROLS, control_text
from agentflow.machine.edits.commands import AddControl, RemoveControl, command_text, read_command
from agentflow.machine.edits.difference import renumber, renumbering
from agentflow.machine.tree import Control
from tests.machine.builders import CAR
from tests.machine.strategies import controlled_machines

DRIVEN = replace(CAR, controls=(Control("motors", 0.0, 5.0, 1.0), Control((4, 6), 0.5, 2.0, -1.0)))
"""The car, whose blocks 3 to 6 are its wheels."""
DESIGNED, FIXED = (
    Brief("t", "o", (), (), (), tuple(range(64)), limits=Limits(controls=window))
    for window in (5.0, None)
)


def edited(script: str, machine: Machine = DRIVEN) -> Machine:
    outcome = apply_script(machine, script, DESIGNED)
    assert outcome.success, outcome.steps
    return outcome.machine


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("Control 3, 6 at 0 for 5 level 1", AddControl((3, 6), 0.0, 5.0, 1.0)),
        ("1. control [3,6] at [0.5] for [1.25] level [-.5]", AddControl((3, 6), 0.5, 1.25, -0.5)),
        ("Control 3 6 at 0 s for 5 s level 1.0.", AddControl((3, 6), 0.0, 5.0, 1.0)),
        ("Control leg at 0 for 5 level 1", AddControl(("leg",), 0.0, 5.0, 1.0)),
        ("Control motors at 0 for 5 level 1", AddControl(("motors",), 0.0, 5.0, 1.0)),
        ("Uncontrol [2]", RemoveControl(2)),
        ("Control motors at 0 for 5", None),
        ("Control at 0 for 5 level 1", None),
        ("Control 3 at . for 5 level 1", None),
        ("Uncontrol motors", None),
    ],
)
def test_reading_commands(line: str, command: object) -> None:
    assert read_command(line) == command


@settings(max_examples=20)
@given(controlled_machines())
def test_the_text_of_a_control_is_the_command_that_adds_it(machine: Machine) -> None:
    script = "\n".join(map(control_text, machine.controls))
    assert apply_script(replace(machine, controls=()), script).machine == machine


def test_entries_are_added_at_the_end_and_removed_by_number() -> None:
    script = "Control steering hinges at 1 for 2 level -1\nUncontrol 0"
    hinged = edited("Add 28 to 0 in 4 as hinge\n" + script)
    assert hinged.controls == (DRIVEN.controls[1], Control("steering_hinges", 1.0, 2.0, -1.0))
    assert edited("Uncontrol 1\nUncontrol 0").controls == ()
    assert edited("Uncontrol 1\nUncontrol 0") == CAR


def test_names_of_new_blocks_can_be_controlled() -> None:
    grown = edited("Add 22 to 0 in 4 as motors\nControl motors at 0 for 1 level 1")
    assert grown.controls[-1] == Control((7,), 0.0, 1.0, 1.0)  # the name, not the group


def test_controls_follow_their_blocks() -> None:
    assert edited("Remove 3\nRemove 4").controls == (
        DRIVEN.controls[0],
        replace(DRIVEN.controls[1], target=(4,)),
    )
    assert edited("Remove 4\nRemove 6").controls == DRIVEN.controls[:1]


@pytest.mark.parametrize(
    ("script", "code", "reason"),
    [
        ("Control 1 at 0 for 1 level 1", "control_block", "control 2: nothing drives block 1"),
        ("Control 9 at 0 for 1 level 1", "block_not_found", "block 9 does not exist"),
        ("Control springs at 0 for 1 level 1", "control_group", "the machine has no springs"),
        ("Control motors at 4 for 2 level 1", "control_time", "ends at 6 s, after the window"),
        ("Control motors at 0 for 1 level 2", "control_level", "level 2 is not from -1 to 1"),
        ("Uncontrol 2", "control_not_found", "no control 2; the controls are 0 to 1"),
        ("Uncontrol 1\nUncontrol 1", "control_not_found", "was removed earlier in this script"),
        ("Remove 3\nRemove 4\nRemove 5\nRemove 6", "control_group", "first Uncontrol 0"),
        ("Control all", "bad_format", "Control [ids or group] at [s] for [s] level [level]; Unc"),
    ],
)
def test_failed_commands_and_reasons(script: str, code: str, reason: str) -> None:
    outcome = apply_script(DRIVEN, script, DESIGNED)
    assert outcome.machine is DRIVEN
    (step,) = (step for step in outcome.steps if step.verdict == "Error")
    assert (step.code, reason in step.reason) == (code, True), step.reason


def test_a_program_has_at_most_64_entries() -> None:
    line = "Control motors at 0 for 1 level 1\n"
    full = edited(line * (MAX_CONTROLS - 2))
    outcome = apply_script(full, line, DESIGNED)
    assert outcome.steps[0].code == "too_many_controls"
    assert edited("Uncontrol 0\n" + line, full).controls[-1].lasts == 1.0


def test_a_task_with_a_schedule_knows_no_such_commands() -> None:
    refused = apply_script(CAR, "Control motors at 0 for 1 level 1", FIXED).steps[0]
    assert (refused.code, refused.reason) == (
        "controls_not_allowed",
        "this task switches all blocks by its own schedule; remove the line",
    )
    assert "Control" not in apply_script(CAR, "Turn left", FIXED).steps[0].reason


def test_earlier_controls_are_told_in_the_numbering_of_now() -> None:
    outcome = apply_script(DRIVEN, "Remove 3", DESIGNED)
    ids = renumbering(DRIVEN, outcome.id_map, outcome.names)
    for line, told in (
        ("Control 4, 6 at 0 for 1 level 0.5", "Control 3, 5 at 0 for 1 level 0.5"),
        ("Control motors at 0 for 1 level 1", "Control motors at 0 for 1 level 1"),
        ("Uncontrol 1", "Uncontrol 1"),
    ):
        command = read_command(line)
        assert command is not None
        assert "".join(map(str, renumber(command_text(command), ids))) == told


def test_3d_information_ends_with_the_program() -> None:
    lines = describe_text(DRIVEN, DESIGNED).splitlines()
    assert lines[-3:] == [
        "Controls, by their numbers:",
        "0. Control motors at 0 for 5 level 1",
        "1. Control 4, 6 at 0.5 for 2 level -1",
    ]
    assert describe(DRIVEN)["controls"] == [control.to_json() for control in DRIVEN.controls]
    assert describe_text(CAR, DESIGNED).endswith("\nNo controls.")
    assert describe_text(CAR, FIXED) == describe_text(CAR)
    assert "controls" not in describe(CAR)
