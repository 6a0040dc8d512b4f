"""The shared search tree: order of nodes, counts, and the end of the budget."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from agentflow.search.node import Attempt, Evaluation, Node
from agentflow.search.registry import STRATEGIES
from agentflow.search.settings import SearchSettings
from agentflow.search.strategies import deals_budget
from agentflow.search.tree import SearchTree, is_better
from tests.search.domain import ONE_KIND, Words

FROM_ONE = [name for name in STRATEGIES if not deals_budget(name)]
"""Strategies that search from one candidate."""

ROOT = Evaluation(True, 1.0, measurements=ONE_KIND)
FAILED, INVALID = Evaluation(valid=True, score=None), Evaluation(valid=False, score=0.0)


@pytest.mark.parametrize(
    ("new", "old", "expected"),
    [
        (Evaluation(True, 2.0), ROOT, True),
        (Evaluation(True, 1.0), ROOT, False),
        (Evaluation(True, -1.0), FAILED, True),
        (Evaluation(True, -1.0), INVALID, True),
        (Evaluation(False, 2.0), ROOT, False),
        (FAILED, INVALID, False),
    ],
)
def test_better_is_valid_scored_and_above(new: Evaluation, old: Evaluation, expected: bool) -> None:
    assert is_better(new, old) is expected


@pytest.mark.parametrize("name", FROM_ONE)
async def test_a_fallback_child_is_not_evaluated_again(name: str) -> None:
    words = Words({f"round-1/node-0/try-{i}": None for i in (1, 2)}, {})
    numbers = SearchSettings(rounds=1, width=1, request_rounds=2)
    found = await STRATEGIES[name]("r", ROOT, words.expand, words.evaluate, numbers)
    assert [(node.candidate, node.evaluation) for node in found.nodes] == [("r", ROOT)] * 2
    assert (words.rollouts, found.cost.rollouts) == ([], 0)


@pytest.mark.parametrize("name", FROM_ONE)
async def test_no_expansion_is_counted_when_the_budget_is_already_spent(
    name: str,
) -> None:
    words = Words({}, {}, budget=0)
    numbers = SearchSettings(rounds=3, width=2, request_rounds=3)
    found = await STRATEGIES[name]("r", ROOT, words.expand, words.evaluate, numbers)
    assert len(words.requests) == 1
    assert (len(found.nodes), found.result, found.stopped) == (1, 0, True)
    assert (found.cost.expansions, found.cost.attempts) == (0, 0)


async def test_an_attempt_that_nobody_was_asked_for_is_a_child_as_well() -> None:
    """It counts towards the width, so that nobody is asked again in its place."""
    asked: list[Sequence[str]] = []

    async def expand(
        _node: Node[str], labels: Sequence[str], _earlier: Sequence[Attempt[str]]
    ) -> list[Attempt[str]]:
        asked.append(labels)
        return [Attempt("besides", "x", ""), *(Attempt(label, None, "no") for label in labels)]

    async def evaluate(candidate: str, _label: str) -> Evaluation:
        return Evaluation(valid=True, score=float(len(candidate)))

    tree = SearchTree("r", Evaluation(valid=True, score=0.0), expand, evaluate, 3, lambda _: None)
    children = await tree.grow(tree.nodes[0], 1, width=1)
    assert [(child.label, child.candidate) for child in children] == [("besides", "x")]
    assert [len(labels) for labels in asked] == [1]
    assert not tree.stopped
