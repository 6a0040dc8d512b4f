import random as chance

import pytest

from agentflow.search.events import Selected
from agentflow.search.node import Evaluation, SearchResult
from agentflow.search.random import random
from agentflow.search.settings import SearchSettings
from tests.search.domain import Chance, Words, scores

ROOT = Evaluation(valid=True, score=1.0)


async def run(words: Words, numbers: SearchSettings) -> SearchResult[str]:
    return await random("r", ROOT, words.expand, words.evaluate, numbers, words.events.append)


async def test_golden_chain() -> None:
    """Four rounds of one child each, 2 request rounds; the width is not used. Root r scores 1.

    Round 1  r: refused, then a. 1 = a (7.0).
    Round 2  a: b at once. 2 = b (0.0), kept although it is worse.
    Round 3  b: refused twice. 3 = b again, not simulated.
    Round 4  b (node 3): c. 4 = c (no score), kept.
    Result   4, the last; the best met is 1.
    """
    replies = {
        "round-1/node-0/try-1": None,
        "round-1/node-0/try-2": "a",
        "round-2/node-1/try-1": "b",
        "round-3/node-2/try-1": None,
        "round-3/node-2/try-2": None,
        "round-4/node-3/try-1": "c",
    }
    words = Words(replies, {"a": 7.0, "b": 0.0, "c": None})
    found = await run(words, SearchSettings(rounds=4, width=4, request_rounds=2))
    assert [(n.id, n.candidate, n.parent, n.evaluation.score) for n in found.nodes] == [
        (0, "r", None, 1.0),
        (1, "a", 0, 7.0),
        (2, "b", 1, 0.0),
        (3, "b", 2, 0.0),
        (4, "c", 3, None),
    ]
    assert [e.path[-1] for e in words.events if isinstance(e, Selected)] == [0, 1, 2, 3]
    assert (found.result, found.best, found.stopped) == (4, 1, False)
    cost = found.cost
    assert (cost.expansions, cost.attempts, cost.valid, cost.rollouts) == (4, 6, 3, 3)


async def test_the_search_ends_with_the_last_node_when_the_budget_runs_out() -> None:
    words = Words({"round-1/node-0/try-1": "a"}, {"a": 0.0}, budget=1)
    found = await run(words, SearchSettings())
    assert (found.result, found.best, found.stopped) == (1, 0, True)


@pytest.mark.slow
async def test_completion_order_changes_nothing() -> None:
    runs = []
    for seed in range(12):
        words = Words(Chance(3), scores(3), delays=chance.Random(seed))
        runs.append((await run(words, SearchSettings()), words.events))
    assert all(found == runs[0][0] and events == runs[0][1] for found, events in runs)
