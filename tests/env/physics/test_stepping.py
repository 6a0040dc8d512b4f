"""How steps are divided."""

from __future__ import annotations

import pytest

from agentflow.env.constants import constants
from agentflow.env.physics.stepping import Stepping


@pytest.mark.parametrize(("rate", "fine"), [(60, 8), (120, 4), (240, 2), (300, 2), (480, 1)])
def test_fine_steps_have_a_rate_of_their_own(rate: float, fine: int) -> None:
    stepping = Stepping(constants(), rate)
    assert stepping.settling == fine
    assert stepping.advance() == 1
    stepping.switch()
    assert stepping.advance() == fine


def test_steps_are_fine_for_a_time_after_the_latest_switch() -> None:
    stepping = Stepping(constants().changed({"fine_time": 0.05}), 120)
    stepping.switch()
    assert [stepping.advance() for _ in range(4)] == [4, 4, 4, 4]
    stepping.switch()
    assert [stepping.advance() for _ in range(8)] == [4, 4, 4, 4, 4, 4, 1, 1]
