"""The constants file and other physics made from it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agentflow.env.constants import constants
from agentflow.errors import UnknownNameError


def test_a_block_type_has_its_own_value_or_the_general_one() -> None:
    found = constants()
    assert found["gravity"] == 32.81
    assert found.of("friction", 49) == 2.0
    assert found.of("friction", 1) == found["friction"] == 0.8


def test_changed_constants_leave_the_shipped_ones_alone() -> None:
    other = constants().changed({"gravity": 9.81, "motor_speed.22": 5.0, "spring_force.45": 7.0})
    assert (other["gravity"], other.of("motor_speed", 22)) == (9.81, 5.0)
    assert other.of("motor_speed", 2) == constants().of("motor_speed", 2)
    assert (other.of("spring_force", 45), other.of("spring_force", 9)) == (7.0, 600.0)
    assert constants()["gravity"] == 32.81
    assert other.digest != constants().digest
    assert (
        other.digest
        == constants()
        .changed({"spring_force.45": 7.0, "motor_speed.22": 5.0, "gravity": 9.81})
        .digest
    )


def test_the_digest_is_of_values_and_units_not_of_prose() -> None:
    found = constants()
    assert found.changed({"gravity": 32.81}).digest == found.digest
    assert found.changed({"gravity": 32.82}).digest != found.digest
    assert replace(found, units={**found.units, "gravity": "ft/s2"}).digest != found.digest


def test_an_unknown_constant_is_named() -> None:
    with pytest.raises(UnknownNameError, match="unknown physical constant 'gravitas'"):
        constants().changed({"gravitas": 1.0})
    with pytest.raises(UnknownNameError, match="gravity"):
        constants()["gravitas"]
