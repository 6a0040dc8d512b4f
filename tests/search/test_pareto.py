"""Dominance and fronts, against brute force; searches that compare several objectives."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.search.mcts import mcts
from agentflow.search.node import Evaluation
from agentflow.search.pareto import Point, dominates, ranks
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import is_better
from tests.search.domain import Words

POINTS = st.lists(
    st.one_of(st.just(()), st.tuples(*[st.integers(0, 3).map(float)] * 3)), max_size=12
)


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ((2.0, 1.0), (1.0, 1.0), True),
        ((1.0, 1.0), (1.0, 1.0), False),
        ((2.0, 0.0), (1.0, 1.0), False),
        ((0.0, 0.0), (), True),
        ((), (0.0, 0.0), False),
        ((), (), False),
    ],
)
def test_a_point_dominates_if_it_is_nowhere_worse_and_somewhere_better(
    one: Point, other: Point, expected: bool
) -> None:
    assert dominates(one, other) is expected


@given(POINTS)
def test_the_number_of_a_front_is_the_longest_chain_of_points_that_dominate(
    points: list[Point],
) -> None:
    def chain(point: Point) -> int:
        return 1 + max((chain(p) for p in points if dominates(p, point)), default=0)

    assert ranks(points) == [chain(point) for point in points]


@given(POINTS)
def test_the_first_front_is_all_that_nothing_dominates(points: list[Point]) -> None:
    found = ranks(points)
    dominated = {j for i, j in product(range(len(points)), repeat=2)
                 if dominates(points[i], points[j])}  # fmt: skip
    assert [front > 1 for front in found] == [i in dominated for i in range(len(points))]


def several(*values: float) -> Evaluation:
    """An evaluation with these objectives; the first is the score."""
    return Evaluation(True, values[0] if values else 0.0, objectives=values)


class Vectors(Words):
    """Words with objectives by word."""

    def __init__(self, replies: dict[str, str | None], points: dict[str, Evaluation]) -> None:
        super().__init__(replies, {})
        self.points = points

    async def evaluate(self, candidate: str, label: str) -> Evaluation:  # noqa: ARG002
        return self.points[candidate]


async def test_a_search_for_a_front_backs_up_the_number_of_each_front() -> None:
    words = Vectors(
        {
            "round-1/node-0/try-1": "small", "round-1/node-0/try-2": "worse",
            "round-2/node-1/try-1": "good", "round-2/node-1/try-2": "failing",
        },
        {
            "small": several(1.0, -1.0), "worse": several(1.0, -6.0),
            "good": several(9.0, -5.0), "failing": several(),
        },
    )  # fmt: skip
    settings = SearchSettings(rounds=2, width=2, request_rounds=1)
    root = several(2.0, -5.0)
    found = await mcts("root", root, words.expand, words.evaluate, settings)
    names = {node.candidate: node.reward for node in found.nodes}
    # "good" dominates the root, which dominates "worse", which only "failing" is worse than
    assert names == {"root": 1.0, "small": 1.0, "worse": 0.5, "good": 1.0, "failing": 0.25}
    assert found.nodes[0].total == pytest.approx(1.0 + 0.5 + 1.0 + 0.25)
    assert found.nodes[found.best].candidate == "good"  # the highest value


def test_of_equal_rewards_the_one_that_dominates_is_better() -> None:
    light, heavy = (Evaluation(True, 5.0, objectives=(5.0, -mass)) for mass in (1.0, 2.0))
    assert is_better(light, heavy)
    assert not is_better(heavy, light)
    assert not is_better(light, light)
