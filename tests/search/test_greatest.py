"""Every strategy ends when a candidate is perfect."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from agentflow.search.node import Evaluation, SearchResult
from agentflow.search.registry import STRATEGIES
from agentflow.search.settings import SearchSettings
from agentflow.search.strategies import deals_budget
from tests.search.domain import ONE_KIND, Words

FROM_ONE = [name for name in STRATEGIES if not deals_budget(name)]
"""Strategies that search from one candidate."""

REPLIES = {
    f"round-{round_}/node-{node}/try-{number}": word
    for round_, word in ((1, "a"), (2, "b"), (3, "c"))
    for node in range(9)
    for number in (1, 2)
}


class Graded(Words):
    """Words of which 10 is the greatest score."""

    async def evaluate(self, candidate: str, label: str) -> Evaluation:
        found = await super().evaluate(candidate, label)
        return replace(found, perfect=found.score == 10.0)


async def search(strategy: str, words: Words, root: Evaluation) -> SearchResult[Any]:
    settings = SearchSettings(strategy=strategy, rounds=3, width=2, request_rounds=1)
    return await STRATEGIES[strategy]("r", root, words.expand, words.evaluate, settings)


@pytest.mark.parametrize("strategy", FROM_ONE)
async def test_no_round_follows_a_perfect_candidate(strategy: str) -> None:
    words = Graded(REPLIES, {"a": 3.0, "b": 10.0, "c": 4.0})
    found = await search(strategy, words, Evaluation(True, 1.0, measurements=ONE_KIND))
    assert [word for word, _ in words.rollouts] == ["a", "b"]
    assert (found.nodes[found.result].candidate, found.perfect, found.stopped) == ("b", True, False)


@pytest.mark.parametrize("strategy", FROM_ONE)
async def test_nothing_follows_a_perfect_root(strategy: str) -> None:
    words = Graded(REPLIES, {})
    found = await search(
        strategy, words, Evaluation(True, 10.0, perfect=True, measurements=ONE_KIND)
    )
    assert (words.requests, found.result, found.perfect, found.cost.rollouts) == ([], 0, True, 0)


@pytest.mark.parametrize("strategy", FROM_ONE)
async def test_other_searches_go_on_to_the_last_round(strategy: str) -> None:
    words = Graded(REPLIES, {"a": 3.0, "b": 9.9, "c": 4.0})
    found = await search(strategy, words, Evaluation(True, 1.0, measurements=ONE_KIND))
    assert not found.perfect
    assert len(words.requests) == 3
