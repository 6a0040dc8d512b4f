"""When a score holds, and which machines are fragile."""

from __future__ import annotations

from typing import Any

import pytest

from agentflow.holding import Holding, with_holding


def verified(*scores: float | None, middle: float | None = 100.0) -> dict[str, Any]:
    """The data of a verification."""
    items = [
        {"variation": f"v{i}", "status": "ok", "score": score} for i, score in enumerate(scores)
    ]
    return {"score": middle, "low": None, "high": None, "scores": items}


def test_a_score_holds_from_half_of_the_verified_one() -> None:
    found = Holding.of_verified(verified(100.0, 50.0, 49.9, 0.0, 180.0))
    assert found == Holding(5, ("v2", "v3"))
    assert (found.holds, found.fragile, str(found)) == (3, True, "holds in 3 of 5, fragile")


def test_a_machine_that_never_fails_is_not_fragile() -> None:
    found = Holding.of_verified(verified(100.0, 90.0))
    assert found is not None
    assert (found.fails, found.fragile, str(found)) == ((), False, "holds in 2 of 2")


def test_above_a_median_of_0_only_what_scores_holds() -> None:
    """A machine that is lucky under the default conditions has a median of 0 and is fragile."""
    found = Holding.of_verified(verified(80.0, 0.0, 0.0, middle=0.0))
    assert found == Holding(3, ("v1", "v2"))
    assert found.fragile


def test_a_machine_that_never_scores_has_nothing_to_lose() -> None:
    found = Holding.of_verified(verified(0.0, 0.0, middle=0.0))
    assert found is not None
    assert (found.holds, found.fragile) == (0, False)


@pytest.mark.parametrize("data", [verified(1.0, None, middle=None), verified(1.0, None)])
def test_nothing_is_known_of_an_incomplete_verification(data: dict[str, Any]) -> None:
    assert Holding.of_verified(data) is None
    assert with_holding(data) == {**data, "holds": None, "fails": None, "fragile": None}


def test_readers_get_the_count_and_the_variations_that_fail() -> None:
    data = verified(100.0, 0.0)
    assert with_holding(data) == {**data, "holds": 1, "fails": ["v1"], "fragile": True}
    assert with_holding(None) is None
