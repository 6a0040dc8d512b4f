"""How many rollouts go into one message."""

from __future__ import annotations

import pytest

pytest.importorskip("ray")

from agentflow.cluster.pool import MOST, RECENT, SHARE, Pace

pytestmark = pytest.mark.cluster


def pace(cost: float, work: float, count: int = 1) -> Pace:
    """After messages that each cost so many seconds, with rollouts of so many seconds."""
    found = Pace()
    for _ in range(RECENT):
        found.note(count * work + cost, count * work, count)
    return found


def test_the_first_message_holds_one_rollout() -> None:
    assert Pace().size(1000, 2) == 1


@pytest.mark.parametrize(
    ("cost", "work", "size"),
    [(0.002, 0.02, 5), (0.002, 0.3, 1), (0.0003, 0.02, 1), (9, 0.02, MOST)],
)
def test_a_message_costs_at_most_its_share_of_the_work(cost: float, work: float, size: int) -> None:
    found = pace(cost, work).size(10**6, 2)
    assert found == size
    assert found == MOST or cost <= SHARE * work * found * (1 + 1e-9)


def test_a_short_queue_is_shared_among_the_workers() -> None:
    slow = pace(1.0, 0.02)
    assert [slow.size(waiting, 4) for waiting in (1, 4, 5, 12, 10**6)] == [1, 1, 2, 3, MOST]


def test_one_slow_message_changes_nothing() -> None:
    steady = pace(0.002, 0.02)
    steady.note(60.0, 0.02, 1)
    assert steady.size(10**6, 2) == 5
