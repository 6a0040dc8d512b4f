"""Numbers of what controls a machine: listed, bounded, written back."""

from __future__ import annotations

from dataclasses import replace

from agentflow.machine import check
from agentflow.machine.controllers.reading import read_controllers
from agentflow.machine.numbers import machine_numbers, with_numbers
from agentflow.machine.tree import ROOT, Control, Machine, Step

DRIVEN = Machine(
    (ROOT, Step(1, 2, 0, 0), Step(2, 2, 0, 1)),
    (Control("motors", 0.0, 2.0, 1.0), Control((1,), 1.0, 3.0, -0.5)),
)
LAWS = {
    "sensors": {"turned": {"kind": "heading", "block": 0}},
    "laws": {"steer": {"kind": "pd", "sensor": "turned", "target": 0, "p": 0.1}},
    "outputs": [{"law": "steer", "blocks": [2]}],
}


def test_times_and_levels_are_within_the_window() -> None:
    numbers = machine_numbers(DRIVEN, 5.0)
    assert [item.path for item in numbers[:3]] == [
        "controls.0.at",
        "controls.0.for",
        "controls.0.level",
    ]
    assert with_numbers(DRIVEN, [item.value for item in numbers], 5.0) == DRIVEN
    for ends in (
        [item.low for item in numbers],
        [item.high for item in numbers],
        [5.0 - 1 / 3, 4.0, 0.12345, 4.9996, 5.0, 1.0],
    ):
        changed = with_numbers(DRIVEN, ends, 5.0)
        assert changed is not None
        assert changed.steps == DRIVEN.steps
        assert all(c.lasts > 0 and round(c.at + c.lasts, 3) <= 5.0 for c in changed.controls)
        assert not check(changed).problems


def test_laws_have_numbers_that_fit_together_or_none() -> None:
    problems: list[object] = []
    laws = read_controllers(LAWS, problems)  # type: ignore[arg-type]
    assert laws is not None, problems
    machine = replace(DRIVEN, controllers=laws)
    numbers = machine_numbers(machine, 5.0)
    values = {item.path: item.value for item in numbers}
    assert values["laws.steer.p"] == 0.1
    assert with_numbers(machine, list(values.values()), 5.0) == machine
    changed = with_numbers(machine, list((values | {"laws.steer.p": 0.25}).values()), 5.0)
    assert changed is not None
    assert changed.controllers is not None
    assert changed.controllers.to_json()["laws"]["steer"]["p"] == 0.25
    crossed = {path: 1.0 if path.endswith("limits.0") else value for path, value in values.items()}
    crossed |= {path: -1.0 for path in values if path.endswith("limits.1")}
    assert with_numbers(machine, list(crossed.values()), 5.0) is None
