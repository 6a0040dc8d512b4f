"""Scripts that name the blocks they add and build on them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.machine import Machine, apply_script, check
from agentflow.machine.edits.script import MAX_COMMANDS
from tests.machine.builders import CAR, CATAPULT, build
from tests.machine.strategies import draw_step, valid_machines
from tests.machine.test_edits import refusals

FRAME = build((1, 0, 0), (1, 0, 1))


def failure(machine: Machine, script: str) -> tuple[int, str, str]:
    """Line (from 1), code and reason of the refusal."""
    outcome = apply_script(machine, script)
    assert not outcome.success
    assert outcome.machine is machine
    assert (outcome.names, outcome.id_map) == ({}, {step.id: step.id for step in machine})
    ((line, step),) = (
        (number, step) for number, step in enumerate(outcome.steps, 1) if step.verdict == "Error"
    )
    assert all(step.verdict == "Unverified" for step in outcome.steps[line:])
    return line, step.code, step.reason


def test_a_named_block_is_a_parent_in_the_next_line() -> None:
    outcome = apply_script(FRAME, "Add 63 to 1 in 0 as a\nAdd 2 to a in 3\nadd 2 to [A] in [4]")
    assert outcome.success
    assert outcome.machine == build((1, 0, 0), (1, 0, 1), (63, 1, 0), (2, 3, 3), (2, 3, 4))
    assert outcome.id_map == {0: 0, 1: 1, 2: 2}
    assert outcome.names == outcome.to_json()["names"] == {"a": 3}


def test_two_ended_blocks_end_on_names() -> None:
    outcome = apply_script(
        FRAME,
        "Add 63 to 0 in 4 as mast\nAdd 15 to 1 in 0 as toe\nAdd 7 to mast in 0 to toe in 4 as tie",
    )
    assert outcome.machine == build((1, 0, 0), (1, 0, 1), (63, 0, 4), (15, 1, 0), (7, 3, 0, 4, 4))
    assert outcome.names == {"mast": 3, "toe": 4, "tie": 5}


def test_added_blocks_are_moved_and_removed_by_name() -> None:
    outcome = apply_script(
        FRAME, "Add 15 to 0 in 4 as a\nAdd 2 to a in 0 as b\nMove a to 0 in 5\nRemove b\nRemove 2"
    )
    assert outcome.machine == build((1, 0, 0), (15, 0, 5))
    assert outcome.names == {"a": 2, "b": None}
    assert outcome.id_map == {0: 0, 1: 1, 2: None}


def test_a_block_is_inserted_between_others() -> None:
    machine = build((15, 0, 4), (63, 1, 0), (2, 2, 3), (9, 2, 1, 0, 1), (15, 0, 0))
    script = "Add 15 to 1 in 1 as a\nMove 2 to a in 0\nMove 5 to 2 in 5\nRemove 4"
    outcome = apply_script(machine, script)
    assert outcome.success, outcome.steps
    assert outcome.machine == build((15, 0, 4), (15, 1, 1), (63, 2, 0), (2, 3, 3), (15, 3, 5))
    assert outcome.id_map == {0: 0, 1: 1, 2: 3, 3: 4, 4: None, 5: 5}
    assert check(outcome.machine).machine_valid


REFUSED = """
Add 2 to leg in 0
line 1, unknown_name: no block has the name leg; use an id, or give the name: 'Add 63 to 3 in 0 as
a'

Add 15 to 0 in 4 as a; Add 2 to leg in 0
line 2, unknown_name: no block has the name leg; the names are: a

Remove 6; Add 2 to a in 0; Add 15 to 0 in 4 as a
line 2, name_not_yet_given: the name a is given only in a later line; move that line up

Add 15 to a in 0 as a
line 1, name_not_yet_given: the name a is given only in a later line; move that line up

Add 15 to 0 in 4 as a; Add 15 to 0 in 5 as A
line 2, name_taken: the name a is already taken by new block 7; choose another name

Add 15 to 0 in 4 as 7
line 1, bad_name: the name 7 looks like an id; give it a letter, as in 'as b7'

Add 15 to 0 in 4 as -1
line 1, bad_name: the name -1 looks like an id; give it a letter, as in 'as b1'

Add 15 to 0 in 4 as to
line 1, bad_name: to is a word of the commands; choose another name

Add 15 to 0 in 4 as left-leg
line 1, bad_name: the name left-leg is not allowed; use at most 32 letters, digits and underscores

Add 15 to 0 in 4 as xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx
line 1, bad_name: the name xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx is not allowed; use at most 32
letters, digits and underscores

Add 15 to 0 in 4 as a; Remove a; Add 2 to a in 0
line 3, parent_removed: a was removed earlier in this script

Add 15 to 0 in 4 as a; Add 15 to a in 0 as b; Move a to b in 0
line 3, parent_not_earlier: block 7 carries block 8; choose a parent that it does not carry

Add 15 to 1 in 5 as a; Move 1 to a in 0
line 2, parent_not_earlier: block 1 carries block 7; choose a parent that it does not carry

Add 15 to 0 in 4 as a; Add 2 to a in 0; Remove a
line 3, has_children: block 7 (Small Wooden Block) still carries 8; remove the blocks it carries
first

Add 63 to 1 in 3 as log
line 1, face_occupied: face 3 of block 1 (Wooden Block) is already taken by block 4 (Powered
Wheel); free faces of block 1: 0, 2, 4, 5, 6, 7, 8

Add 63 to 1 in 0 as log; Add 63 to log in 0; Add 63 to 0 in 4 as mast; \
Add 63 to mast in 0 as top; Add 63 to top in 0 as tip
line 5, size_limit: with Log as new block 11 (tip): the machine is 10.5 m along y, 1.0 m over the
limit of 9.5 m; block 3 (Powered Wheel) extends furthest to y- and block 11 (Log) to y+
"""
"""Edits of the car."""


@pytest.mark.parametrize(("script", "told"), refusals(REFUSED))
def test_refusals(script: str, told: str) -> None:
    line, code, reason = failure(CAR, script)
    assert f"line {line}, {code}: {reason}" == told


def test_a_very_long_script_is_refused_as_a_whole() -> None:
    outcome = apply_script(CATAPULT, "Add 15 to 0 in 4 as a\nRemove a\n" * 5000)
    assert not outcome.success
    (step,) = outcome.steps
    assert (step.text, step.code) == ("", "too_many_commands")
    assert step.reason == (
        f"the script has 10000 commands; the maximum is {MAX_COMMANDS}: send fewer, or a whole "
        "machine"
    )


@given(st.data())
def test_a_chained_script_equals_the_same_script_in_steps(data: st.DataObject) -> None:
    """Chained additions by name give the same machine as single additions by the new ids."""
    machine = data.draw(valid_machines())
    stepwise, lines = machine, list[str]()
    for _ in range(data.draw(st.integers(1, 6))):
        step = draw_step(data.draw, list(stepwise.steps))
        added = apply_script(stepwise, _add_line(step.type, step.attachments))
        if added.success:
            names = [
                (f"n{parent - len(machine)}" if parent >= len(machine) else parent, face)
                for parent, face in step.attachments
            ]
            lines.append(f"{_add_line(step.type, names)} as n{len(stepwise) - len(machine)}")
            stepwise = added.machine
    chained = apply_script(machine, "\n".join(lines))
    assert chained.success
    assert chained.machine == stepwise
    new = range(len(machine), len(stepwise))
    assert chained.names == {f"n{number}": id_ for number, id_ in enumerate(new)}
    undo = "\n".join(f"Remove {id_}" for id_ in reversed(new))
    assert apply_script(stepwise, undo).machine == machine


def _add_line(kind: int, ends: object) -> str:
    assert isinstance(ends, tuple | list)
    return " ".join([f"Add {kind}", *(f"to {parent} in {face}" for parent, face in ends)])
