"""The physics that prompts state, against the engine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from agentflow.env.constants import constants
from agentflow.machine import library
from agentflow.prompts.render import facts
from benchmarks.facts import MEASURED, stated

LOOSE = {"bounce": 0.2, "thrust": 0.06}
"""Relative tolerance where single steps matter, or the weight of the car; 0.025 elsewhere."""
CONSTANTS = {("suspension", "damping"): "suspension_damping"}
"""Facts that are constants of the engine and are not measured."""
PAGE = Path(__file__).parents[2] / "docs" / "physics.md"


def _paths(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield from _paths(item, (*path, key))
    else:
        yield path


@pytest.mark.parametrize("path", MEASURED, ids=lambda path: ".".join(map(str, path)))
def test_the_engine_agrees(path: tuple[str | int, ...]) -> None:
    tolerance = LOOSE.get(str(path[0]), 0.025)
    assert MEASURED[path]() == pytest.approx(stated(path), rel=tolerance)


def test_every_fact_is_measured_or_a_constant() -> None:
    for path in set(_paths(facts())) - set(MEASURED):
        if path[0] != "strength":
            assert stated(path) == constants()[CONSTANTS[path]], path


def test_strengths_and_motors_are_those_of_the_engine() -> None:
    strength, value = facts()["strength"], constants()
    for kind in library():
        own = strength.get(kind, strength["usual"])
        assert own == [value.of("strength_force", kind), value.of("strength_torque", kind)]
        motor = facts()["motor"].get(kind, {"torque": 0.0, "speed": 0.0})
        assert motor["torque"] == value.of("motor_torque", kind)
        assert motor["speed"] == value.of("motor_speed", kind)


def test_the_documentation_shows_the_same_numbers() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for path in MEASURED:
        assert f"| {'.'.join(map(str, path))} | {stated(path):g} |" in page
