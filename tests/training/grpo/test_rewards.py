"""Rewards for reinforcement learning, of real simulations."""

from __future__ import annotations

from math import log1p

import pytest

from agentflow.rewards import reward
from agentflow.training.grpo.judging import performance, shaped
from tests.integrations.foreign import CAR
from tests.llm.foreign import ROOT

MACHINES = ROOT / "tests" / "machines"
OVERLAP = """[{"id": 0, "type": 0, "parent": -1, "face_id": -1},
{"id": 1, "type": 15, "parent": 0, "face_id": 0}, {"id": 2, "type": 15, "parent": 0, "face_id": 0}]
"""


def test_movement_is_the_distance_of_the_root() -> None:
    found = reward("movement", CAR, knobs={"window": 1})
    assert performance("movement", found) == found.rollout.terms["distance"] == found.value
    assert found.value is not None
    assert found.value > 1


@pytest.mark.slow
def test_throwing_is_height_times_distance_of_a_throw_above_three_metres() -> None:
    text = (MACHINES / "throwing" / "spring_arm.json").read_text()
    found = reward("throwing", text)
    terms = found.rollout.terms
    assert float(terms["height"] or 0) > 3
    expected = float(terms["height"] or 0) * float(terms["distance"] or 0)
    assert performance("throwing", found) == pytest.approx(expected)
    assert shaped("throwing", found) == pytest.approx(
        1 + 0.3 * log1p(float(terms["distance"] or 0))
    )


def test_other_families_are_scaled_by_a_good_score() -> None:
    found = reward("gearing", "no machine")
    assert performance("gearing", found) == 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [("I cannot.", 0.0), (OVERLAP, 0.1), (CAR, 0.3)],
    ids=["text", "overlap", "no boulder"],
)
def test_every_step_towards_a_valid_machine_counts(text: str, expected: float) -> None:
    found = reward("throwing", text)
    assert not found.valid
    assert shaped("throwing", found) == pytest.approx(expected)
    assert performance("throwing", found) == 0
