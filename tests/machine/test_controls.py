"""Control programs: their file form, what is wrong with them, and what they switch when."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agentflow.machine import Machine, check, read_machine
from agentflow.machine.brief import Brief, Limits
from agentflow.machine.controls import MAX_CONTROLS, NOT_DESIGNED, switches
from agentflow.machine.formats.coordinates import read_coordinates, to_coordinates
from agentflow.machine.formats.detect import read_any
from agentflow.machine.tree import Control, renumber
from tests.machine.builders import CAR
from tests.machine.strategies import controlled_machines

LEFT = Control((4, 6), 0.5, 2.0, -1.0)
"""Two wheels of the car; its blocks 3 to 6 are wheels."""
DRIVEN = replace(CAR, controls=(Control("motors", 0.0, 5.0, 1.0), LEFT))


def task(window: float | None) -> Brief:
    limits = Limits(controls=window)
    return Brief("t", "o", (), (), (), tuple(range(100)), limits=limits)


def problems(controls: Any, window: float | None = 5.0) -> list[tuple[str, str]]:
    report = check({"blocks": [step.to_json() for step in CAR], "controls": controls}, task(window))
    return [(problem.code, problem.message) for problem in report.problems]


def entry(**changes: object) -> dict[str, object]:
    item: dict[str, object] = {"blocks": [3], "at": 0, "for": 1, "level": 1, **changes}
    return {key: value for key, value in item.items() if value is not None}


@settings(max_examples=20)
@given(controlled_machines())
def test_written_machines_are_read_back(machine: Machine) -> None:
    assert read_machine(machine.to_text()).machine == machine
    assert read_machine(f"Here:\n```json\n{machine.to_text()}\n```\nDone.").machine == machine
    assert read_any(json.dumps(machine.to_json())).machine == machine


def test_coordinates_keep_controls() -> None:
    assert read_coordinates(to_coordinates(DRIVEN)).machine == DRIVEN
    assert read_any(json.dumps(to_coordinates(DRIVEN))).machine == DRIVEN


def test_a_machine_without_controls_is_written_as_a_list() -> None:
    data = [step.to_json() for step in CAR]
    assert CAR.to_json() == data
    bare = read_machine({"blocks": data, "controls": []}).machine
    assert (bare, bare and bare.digest) == (CAR, CAR.digest)
    assert DRIVEN.digest != CAR.digest


def test_numbers_are_written_as_short_as_they_are() -> None:
    assert DRIVEN.to_text().splitlines()[-4:] == [
        '"controls": [',
        '  {"group": "motors", "at": 0, "for": 5, "level": 1},',
        '  {"blocks": [4, 6], "at": 0.5, "for": 2, "level": -1}',
        "]}",
    ]


@pytest.mark.parametrize(
    ("item", "code", "message"),
    [
        (entry(blocks=[3, 9]), "control_block", "block 9 does not exist; the blocks are 0 to 6"),
        (entry(blocks=[1]), "control_block", "nothing drives block 1 (Wooden Block); the "),
        (entry(blocks=None, group="springs"), "control_group", "no springs; its groups: motors"),
        (entry(blocks=None, group="wheels"), "control_block", 'or "group", one of motors, '),
        (entry(blocks=None), "control_block", "control 0 has neither blocks nor group"),
        (entry(at=-1), "control_time", "begins at -1 s and lasts 1 s; it must begin at 0 or later"),
        (entry(at=4.5), "control_time", "ends at 5.5 s, after the window of 5 s"),
        (entry(level=1.5), "control_level", "control 0: level 1.5 is not from -1 to 1"),
        (entry(level=None), "control_number", "control 0 has no 'level'"),
        (entry(at="soon"), "control_number", "control 0 has 'at' 'soon', expected a number"),
        (7, "not_a_control", "control 0 is 7; expected an object like"),
    ],
)
def test_each_fault_of_a_control_is_told(item: object, code: str, message: str) -> None:
    ((found, text),) = problems([item])
    assert (found, message in text) == (code, True), text


def test_a_program_has_at_most_64_entries() -> None:
    assert problems([entry()] * MAX_CONTROLS) == []
    ((code, text),) = problems([entry()] * (MAX_CONTROLS + 2))
    assert code == "too_many_controls"
    assert text.endswith("at most 64 are allowed: remove at least 2")


def test_a_task_with_a_schedule_refuses_controls() -> None:
    assert problems([entry()], window=None) == [("controls_not_allowed", NOT_DESIGNED)]
    assert check(DRIVEN).problems == ()  # without a task they may be anything


def test_the_last_control_begun_holds() -> None:
    controls = (
        Control((3,), 1.0, 4.0, 0.5),
        Control((3,), 0.0, 2.0, 1.0),  # begins earlier, so it gives way at 1 s
        Control((3,), 1.0, 1.0, -1.0),  # later in the program than the one that begins with it
    )
    assert switches(replace(CAR, controls=controls)) == (
        (0.0, 3, 1.0),
        (1.0, 3, -1.0),
        (2.0, 3, 0.5),
        (5.0, 3, 0.0),
    )


def test_a_group_drives_all_its_blocks() -> None:
    assert switches(replace(CAR, controls=DRIVEN.controls[:1])) == tuple(
        (time, block, level) for time, level in ((0.0, 1.0), (5.0, 0.0)) for block in (3, 4, 5, 6)
    )


@settings(max_examples=20)
@given(st.permutations(range(1, 7)))
def test_controls_follow_their_blocks_to_new_numbers(order: list[int]) -> None:
    kept = [step for step in CAR if step.id not in order[:2] and not {1, 2} & set(order[:2])]
    machine, ids = renumber(kept, DRIVEN.controls)
    left = tuple(ids[block] for block in (4, 6) if block in ids)
    expected = [DRIVEN.controls[0], *([replace(LEFT, target=left)] if left else [])]
    assert list(machine.controls) == expected
