import random

import pytest

from agentflow.search.best_of_n import best_of_n
from agentflow.search.events import Selected
from agentflow.search.node import Evaluation, SearchResult
from agentflow.search.settings import SearchSettings
from tests.search.domain import Chance, Words, scores

ROOT = Evaluation(valid=True, score=1.0)


async def run(words: Words, numbers: SearchSettings) -> SearchResult[str]:
    return await best_of_n("r", ROOT, words.expand, words.evaluate, numbers, words.events.append)


async def test_golden_tree() -> None:
    """Four rounds, width 3, 2 request rounds. Root r scores 1.

    Round 1  r. Wave 1: a, refused, b; wave 2: c. 1 = a (0.5), 2 = b (3.0), 3 = c (3.0).
             b and c are equal and better than r: the lower id, b, takes over.
    Round 2  b. Two rounds of three requests, all refused: 4 = b again, not simulated.
    Round 3  b (node 2) again. 5 = c (3.0, known), 6 = d (no score), 7 = e (2.9). None is better.
    Round 4  b once more. 8 = f (4.0), 9 = g (3.5), 10 = h (4.0). 8 takes over and is the result.
    """
    replies = {
        **dict(
            zip(
                [f"round-1/node-0/try-{i}" for i in (1, 2, 3, 4)],
                ["a", None, "b", "c"],
                strict=True,
            )
        ),
        **{f"round-2/node-2/try-{i}": None for i in range(1, 7)},
        **{f"round-3/node-2/try-{i}": w for i, w in enumerate("cde", start=1)},
        **{f"round-4/node-2/try-{i}": w for i, w in enumerate("fgh", start=1)},
    }
    known = dict(zip("abcdefgh", [0.5, 3.0, 3.0, None, 2.9, 4.0, 3.5, 4.0], strict=True))
    words = Words(replies, known)
    found = await run(words, SearchSettings(rounds=4, width=3, request_rounds=2))
    assert [(n.id, n.candidate, n.parent, n.evaluation.score) for n in found.nodes] == [
        (0, "r", None, 1.0),
        (1, "a", 0, 0.5),
        (2, "b", 0, 3.0),
        (3, "c", 0, 3.0),
        (4, "b", 2, 3.0),
        (5, "c", 2, 3.0),
        (6, "d", 2, None),
        (7, "e", 2, 2.9),
        (8, "f", 2, 4.0),
        (9, "g", 2, 3.5),
        (10, "h", 2, 4.0),
    ]
    assert [e.path for e in words.events if isinstance(e, Selected)] == [
        (0,),
        (0, 2),
        (0, 2),
        (0, 2),
    ]
    assert (found.result, found.best, found.stopped) == (8, 8, False)
    cost = found.cost
    assert (cost.expansions, cost.attempts, cost.valid, cost.rollouts) == (4, 16, 9, 8)


async def test_the_search_ends_with_the_best_node_when_the_budget_runs_out() -> None:
    words = Words({f"round-1/node-0/try-{i}": "ab"[i % 2] for i in (1, 2, 3, 4)}, {"a": 0, "b": 2})
    words.budget = 3
    found = await run(words, SearchSettings(rounds=5, width=4))
    assert [n.candidate for n in found.nodes] == ["r", "b", "a", "b"]
    assert (found.result, found.stopped, found.cost.rollouts) == (1, True, 2)
    assert words.requests == [("r", 4, 0)]


@pytest.mark.slow
async def test_completion_order_changes_nothing() -> None:
    runs = []
    for seed in range(12):
        words = Words(Chance(3), scores(3), delays=random.Random(seed))
        runs.append((await run(words, SearchSettings()), words.events))
    assert all(found == runs[0][0] and events == runs[0][1] for found, events in runs)
