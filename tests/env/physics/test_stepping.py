"""How steps are divided."""

from __future__ import annotations

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.stepping import Stepping


@pytest.mark.parametrize(
    ("rate", "settling", "fine"), [(60, 8, 8), (120, 4, 4), (240, 2, 2), (300, 2, 2), (480, 1, 1)]
)
def test_fine_steps_have_a_rate_of_their_own(rate: float, settling: int, fine: int) -> None:
    stepping = Stepping(constants(), rate, 480)
    assert stepping.settling == settling
    assert stepping.advance(0.0) == 1
    stepping.switch()
    assert stepping.advance(0.0) == fine


def test_steps_are_fine_for_a_time_after_the_latest_switch() -> None:
    stepping = Stepping(constants().changed({"fine_time": 0.05}), 120, 480)
    stepping.switch()
    assert [stepping.advance(0.0) for _ in range(4)] == [4, 4, 4, 4]
    stepping.switch()
    assert [stepping.advance(0.0) for _ in range(8)] == [4, 4, 4, 4, 4, 4, 1, 1]


@pytest.mark.parametrize(("heavy", "fine"), [(5, 24), (6, 6)])
def test_steps_are_fine_for_longer_if_loads_are_great_before_they_become_coarse(
    heavy: int, fine: int
) -> None:
    physics = constants().changed({"fine_time": 0.05, "fine_time_loaded": 0.2, "fine_load": 0.5})
    stepping = Stepping(physics, 120, 480)
    stepping.switch()
    taken = [stepping.advance(0.5 if step == heavy else 0.4) for step in range(30)]
    assert taken == [4] * fine + [1] * (30 - fine)
