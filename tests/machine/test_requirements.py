"""Requirements: how they are read, and those that need no simulation, by hand."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from agentflow.env.tasks.registry import get_task
from agentflow.errors import ConfigError
from agentflow.machine.blocks.library import library
from agentflow.machine.brief import Brief
from agentflow.machine.description.geometry_info import describe_text
from agentflow.machine.geometry.placement import place
from agentflow.machine.requirements import Judged, Requirement, Requirements, usual_prices
from agentflow.machine.tree import Machine
from agentflow.machine.validity import check
from tests.machine.builders import CAR, build

TOWER = build((63, 0, 4), (35, 1, 0), (35, 2, 0))
"""A root of 1 m, a log of 3 m on it, two ballasts of 1 m on top."""


def wanted(text: str, **knobs: object) -> Brief:
    return get_task("movement", {"requirements.wanted": text, **knobs}).brief


def judged(text: str) -> dict[str, float | None]:
    items = tuple(map(Requirement.parse, text.split(",")))
    found = Requirements(items, prices=usual_prices()).judge(place(TOWER))
    return {item.requirement.quantity: item.value for item in found}


def test_static_quantities_are_exact() -> None:
    found = judged(
        "mass <= 9 kg, cost <= 9, blocks <= 9, types <= 9, width <= 9 m, height <= 9 m,"
        "length <= 9 m, safety >= 2"
    )
    assert found == {
        "mass": 0.25 + 1.0 + 2 * 3.0,
        "cost": 0 + 3 + 2 * 4,
        "blocks": 4,
        "types": 3,
        "width": 1.0,
        "height": 6.0,
        "length": 1.0,
    }


def test_every_type_has_a_price() -> None:
    assert usual_prices().keys() == library().keys()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mas <= 3", "'mas <= 3' is not a requirement such as 'mass <= 60 kg'; quantities: mass"),
        ("mass <= -3 kg", "-3 must be a number of at least 0"),
        ("mass <= 3 m", "mass is in kg"),
        ("blocks <= 3 kg", "blocks is without a unit"),
        ("mass <= 1e999", "1e999 must be a number"),
        ("tolerance >= 80 %", "write how far blocks are displaced after tolerance"),
        ("tolerance of 0 m >= 80 %", "write how far blocks are displaced after tolerance"),
        ("mass of 2 m <= 3", "write how far blocks are displaced after tolerance"),
        ("tolerance of 2 m >= 80 %", "a tolerance of 2 m is larger than the smallest side"),
        ("mass >= 20, mass <= 10", "mass >= 20 kg contradicts mass <= 10 kg: change or remove"),
        ("blocks = 20, blocks = 10", "blocks = 20 contradicts blocks = 10"),
        ("types >= 5, blocks <= 3", "types >= 5 contradicts blocks <= 3"),
    ],
)
def test_a_wrong_requirement_is_refused_in_a_sentence(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        wanted(text)
    assert "requirements.wanted of movement: " in str(error.value)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("prices", "message"),
    [
        ({1: -2}, "the price of 1 (Wooden Block) is -2 credits; it must not be negative"),
        ({999: 2}, "999 is not a block type"),
        ({"x": 2}, "must be block type: credits, not 'x'"),
    ],
)
def test_a_wrong_price_is_refused_in_a_sentence(prices: object, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        wanted("cost <= 3", **{"requirements.prices": prices})
    assert message in str(error.value)


def test_designers_read_requirements_and_prices_where_cost_matters() -> None:
    sentences = wanted("mass <= 60 kg, cost <= 9", **{"requirements.prices": {63: 7.5}}).score
    assert "Requirements: mass: at most 60 kg; cost: at most 9 credits." in sentences[-2]
    assert sentences[-2].startswith("The score counts only if all requirements are met")
    assert "Log 7.5" in sentences[-1]
    assert "Prices" not in wanted("mass <= 60 kg").score[-1]
    lenient = wanted("mass <= 60 kg", **{"requirements.mode": "report"}).score[-1]
    assert "which do not change the score" in lenient


def test_check_judges_what_needs_no_simulation() -> None:
    report = check(CAR, wanted("mass <= 3 kg, blocks <= 9, safety >= 2"))
    assert report.task_valid
    assert [item.met for item in report.requirements] == [False, True]
    assert [item.code for item in report.warnings] == ["requirement"]
    assert "mass 5.25 of at most 3 kg (missed by 2.25)" in report.warnings[0].message
    assert "requirements" not in check(CAR, get_task("movement").brief).to_json()


def test_what_is_judged_is_read_as_it_was_written() -> None:
    for text, value in (("safety >= 1.5", inf), ("mass <= 3 kg", 2.5), ("tilt <= 3 degrees", None)):
        item = Judged(Requirement.parse(text), value, "why")
        assert Judged.from_json(item.to_json()) == item
        assert str(item.requirement) == text


@pytest.mark.parametrize(
    ("text", "value", "missing"),
    [
        ("safety >= 1.5", 1.5, 0.0),
        ("safety >= 1.5", 0.75, 0.5),
        ("mass <= 10 kg", 20.0, 1.0),
        ("mass <= 10 kg", 12.5, 0.25),
        ("broken <= 0", 1.0, 1.0),
        ("blocks = 10", 9.0, 0.1),
        ("safety >= 1.5", None, 1.0),
    ],
)
def test_the_shortfall_is_a_share_of_what_is_required(
    text: str, value: float | None, missing: float
) -> None:
    assert Judged(Requirement.parse(text), value).shortfall == pytest.approx(missing)


def test_what_cannot_be_built_is_told_why() -> None:
    assert judged("buildable") == {"buildable": 1.0}
    clamp = Machine.from_file(Path(__file__).parents[1] / "machines" / "bridge" / "clamp.json")
    (found,) = Requirements((Requirement.parse("buildable"),)).judge(place(clamp))
    assert not found.met
    assert str(found).startswith("buildable 0 of 1 (missed by 1): the machine cannot be built")


def test_descriptions_tell_what_is_required_and_there() -> None:
    text = describe_text(CAR, wanted("mass <= 3 kg, safety >= 2"))
    assert "Required: mass 5.25 of at most 3 kg (missed by 2.25)." in text
    assert "Required" not in describe_text(CAR, get_task("movement").brief)
