"""The search for reference machines: repeatable, never worse than what it starts from."""

from __future__ import annotations

from random import Random

import pytest

from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from benchmarks.climbing import Found, climb
from tests.env.machines import CAR

TASK = get_task("movement", {"window": 1})


@pytest.mark.slow
async def test_the_same_seed_finds_the_same_machine() -> None:
    told: list[tuple[int, Found]] = []
    one = await climb(
        TASK, 3, Random(1), CAR, tell=lambda count, found: told.append((count, found))
    )
    two = await climb(TASK, 3, Random(1), CAR)
    assert one == two
    assert told[0][0] == 1
    assert told[0][1].machine == CAR
    assert one.value >= told[0][1].value
    assert one == told[-1][1]


async def test_a_search_without_rollouts_finds_nothing() -> None:
    with pytest.raises(UsageError, match="a search needs at least one rollout, not 0"):
        await climb(TASK, 0, Random(1))
