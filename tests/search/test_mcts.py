import math
import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.search.events import BackedUp, Expanded, Selected, Simulated
from agentflow.search.mcts import mcts
from agentflow.search.node import Evaluation, SearchResult
from agentflow.search.settings import SearchSettings, UcbSettings
from tests.search.domain import Chance, Words, scores

SMALL = SearchSettings(rounds=5, width=2, request_rounds=3, ucb=UcbSettings(c=1.0))
REPLIES: dict[str, str | None] = {
    "round-1/node-0/try-1": None,
    "round-1/node-0/try-2": "a",
    "round-1/node-0/try-3": "b",
    **{f"round-2/node-1/try-{i}": None for i in range(1, 7)},
    "round-3/node-2/try-1": "c",
    "round-3/node-2/try-2": "d",
    "round-4/node-3/try-1": "c",
    "round-4/node-3/try-2": "e",
    "round-5/node-7/try-1": "f",
    "round-5/node-7/try-2": "g",
}
SCORES: dict[str, float | None] = {
    "a": 2.0,
    "b": 2.0,
    "c": 5.0,
    "d": 0.0,
    "e": None,
    "f": 5.0,
    "g": 4.0,
}
ROOT = Evaluation(valid=True, score=1.0)


async def run(words: Words, numbers: SearchSettings = SMALL) -> SearchResult[str]:
    return await mcts("r", ROOT, words.expand, words.evaluate, numbers, words.events.append)


async def test_golden_tree() -> None:
    """Five rounds, width 2, 3 request rounds, c = 1, rewards scaled by the tree so far. r scores 1.

    Round 1  only the root. Request 1 is for two: refused, a. Request 2 for the one missing: b.
             1 = a (2.0), 2 = b (2.0). Visits/totals: 1: 1/2, 2: 1/2, root 2/4.
    Round 2  1 and 2 are equal: the lower id. Three requests of two, all refused: the parent again.
             3 = a (2.0, not simulated again). 3: 1/2, 1: 2/4, root 3/6.
    Round 3  rewards 1..2. 1: 1 + sqrt(ln 3 / 2) = 1.741; 2: 1 + sqrt(ln 3 / 1) = 2.048.
             4 = c (5.0), 5 = d (0.0) below 2. 4: 1/5, 5: 1/0, 2: 3/7, root 5/11.
    Round 4  rewards 0..5. 1: 0.4 + sqrt(ln 5 / 2) = 1.297; 2: 7/15 + sqrt(ln 5 / 3) = 1.199.
             Below 1 is only 3. 6 = c (5.0, known from 4), 7 = e (no score: the computer failed).
             Only 6 is backed up. 6: 1/5, 3: 2/7, 1: 3/9, root 6/16.
    Round 5  1: 0.6 + sqrt(ln 6 / 3) = 1.373; 2: 7/15 + sqrt(ln 6 / 3) = 1.240. 3. Then 7, which is
             unvisited. 8 = f (5.0), 9 = g (4.0).
             8: 1/5, 9: 1/4, 7: 2/9, 3: 4/16, 1: 5/18, root 8/25.
    Result   4, 6 and 8 score 5.0: the lowest id, which no later round looked at again.
    """
    words = Words(REPLIES, SCORES)
    found = await run(words)
    assert [
        (n.id, n.candidate, n.parent, n.evaluation.score, n.children, n.visits, n.total)
        for n in found.nodes
    ] == [
        (0, "r", None, 1.0, [1, 2], 8, 25.0),
        (1, "a", 0, 2.0, [3], 5, 18.0),
        (2, "b", 0, 2.0, [4, 5], 3, 7.0),
        (3, "a", 1, 2.0, [6, 7], 4, 16.0),
        (4, "c", 2, 5.0, [], 1, 5.0),
        (5, "d", 2, 0.0, [], 1, 0.0),
        (6, "c", 3, 5.0, [], 1, 5.0),
        (7, "e", 3, None, [8, 9], 2, 9.0),
        (8, "f", 7, 5.0, [], 1, 5.0),
        (9, "g", 7, 4.0, [], 1, 4.0),
    ]
    assert (found.result, found.best, found.stopped) == (4, 4, False)
    cost = found.cost
    assert (cost.expansions, cost.attempts, cost.valid, cost.rollouts) == (5, 15, 8, 7)
    assert cost.seconds > 0


async def test_later_requests_fill_missing_children_and_see_earlier_attempts() -> None:
    words = Words(REPLIES, SCORES)
    await run(words)
    assert words.requests == [
        *[("r", 2, 0), ("r", 1, 2)],
        *[("a", 2, 0), ("a", 2, 2), ("a", 2, 4)],
        *[("b", 2, 0), ("a", 2, 0), ("e", 2, 0)],
    ]


async def test_each_word_is_evaluated_once_under_its_first_label() -> None:
    words = Words(REPLIES, SCORES)
    await run(words)
    assert words.rollouts == [
        ("a", "round-1/node-1"),
        ("b", "round-1/node-2"),
        ("c", "round-3/node-4"),
        ("d", "round-3/node-5"),
        ("e", "round-4/node-7"),
        ("f", "round-5/node-8"),
        ("g", "round-5/node-9"),
    ]


async def test_events() -> None:
    words = Words(REPLIES, SCORES)
    found = await run(words)
    assert [e.path for e in words.events if isinstance(e, Selected)] == [
        (0,),
        (0, 1),
        (0, 2),
        (0, 1, 3),
        (0, 1, 3, 7),
    ]
    expanded = [e for e in words.events if isinstance(e, Expanded)]
    assert [(e.round, e.node, e.children, e.fallback) for e in expanded] == [
        (1, 0, (1, 2), False),
        (2, 1, (3,), True),
        (3, 2, (4, 5), False),
        (4, 3, (6, 7), False),
        (5, 7, (8, 9), False),
    ]
    assert [len(e.attempts) for e in expanded] == [3, 6, 2, 2, 2]
    simulated = [e.node for e in words.events if isinstance(e, Simulated)]
    assert simulated == list(found.nodes[1:])
    assert [n.label for n in simulated][:3] == ["round-1/node-0/try-2", "round-1/node-0/try-3", ""]
    assert [e for e in words.events if isinstance(e, BackedUp)][-2:] == [
        BackedUp(5, (0, 1, 3, 7, 8), 5.0),
        BackedUp(5, (0, 1, 3, 7, 9), 4.0),
    ]


async def test_defaults_ask_for_four_at_once() -> None:
    """Four wanted; the first wave gives one, the second none, the third two, the fifth the last."""
    valid = {2: "a", 9: "b", 10: "c", 12: "d"}
    replies = {f"round-1/node-0/try-{i}": valid.get(i) for i in range(1, 20)}
    words = Words(replies, {"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0})
    found = await run(words, SearchSettings(rounds=1))
    assert [asked for _, asked, _ in words.requests] == [4, 3, 3, 1, 1]
    assert [n.candidate for n in found.nodes] == ["r", "a", "b", "c", "d"]


async def test_requests_end_with_fewer_children() -> None:
    replies = {f"round-1/node-0/try-{i}": "a" if i == 3 else None for i in range(1, 17)}
    words = Words(replies, {"a": 0.5})
    found = await run(words, SearchSettings(rounds=1))
    assert [asked for _, asked, _ in words.requests] == [4, 3, 3, 3, 3]
    assert [n.candidate for n in found.nodes] == ["r", "a"]
    assert (found.result, found.best) == (0, 0)


async def test_missing_or_invalid_scores_are_never_best() -> None:
    words = Words({f"round-1/node-0/try-{i}": "x" for i in (1, 2, 3, 4)}, {"x": None})
    found = await mcts(
        "r",
        Evaluation(valid=True, score=-3.0),
        words.expand,
        words.evaluate,
        SearchSettings(rounds=1),
    )
    assert (found.result, found.nodes[0].visits) == (0, 0)


async def test_no_rounds_give_the_root() -> None:
    found = await run(Words({}, {}), SearchSettings(rounds=0))
    assert (len(found.nodes), found.result, found.best) == (1, 0, 0)


@pytest.mark.parametrize(
    ("budget", "nodes", "attempts", "rollouts"),
    [
        (0, "r", 0, 0),
        (1, "r", 1, 0),
        (2, "ra", 2, 1),
        (3, "rab", 3, 2),
        (9, "raba", 9, 2),
        (10, "rabac", 10, 3),
        (14, "rabacdcef", 14, 6),
    ],
)
async def test_the_search_keeps_completed_attempts_when_the_budget_runs_out(
    budget: int, nodes: str, attempts: int, rollouts: int
) -> None:
    """Children received before the budget ran out are simulated and backed up; then it stops."""
    words = Words(REPLIES, SCORES, budget=budget)
    found = await run(words)
    assert "".join(n.candidate for n in found.nodes) == nodes
    assert found.stopped
    assert (found.cost.attempts, found.cost.rollouts) == (attempts, rollouts)
    whole = await run(Words(REPLIES, SCORES))
    for stopped, node in zip(found.nodes, whole.nodes, strict=False):
        assert replace(node, children=[], visits=0, total=0.0) == replace(
            stopped, children=[], visits=0, total=0.0
        )


@pytest.mark.slow
async def test_completion_order_changes_nothing() -> None:
    """Twelve runs with replies and rollouts delayed at random: same nodes, same events."""
    runs = []
    for seed in range(12):
        words = Words(Chance(7), scores(7), delays=random.Random(seed))
        runs.append((await run(words, SearchSettings()), words.events))
    assert all(found == runs[0][0] and events == runs[0][1] for found, events in runs)
    assert len(runs[0][0].nodes) > 12


@given(
    seed=st.integers(0, 10**6),
    width=st.integers(1, 5),
    requests=st.integers(1, 4),
    rounds=st.integers(0, 8),
    scale=st.sampled_from(["minmax", "none"]),
)
async def test_back_up_updates_visits_and_totals(
    seed: int, width: int, requests: int, rounds: int, scale: str
) -> None:
    """A node's visits and total cover itself and the scored nodes below it."""
    numbers = SearchSettings.model_validate(
        {"rounds": rounds, "width": width, "request_rounds": requests, "ucb": {"scale": scale}}
    )
    found = await run(Words(Chance(seed), scores(seed)), numbers)
    nodes = found.nodes
    for node in nodes:
        below = [
            n.evaluation.score
            for n in nodes[1:]
            if n.evaluation.score is not None and node.id in _ancestry(nodes, n.id)
        ]
        assert node.visits == len(below)
        assert node.total == pytest.approx(math.fsum(below))
        assert len(node.children) <= width
    assert found.cost.expansions == rounds
    best = max(n.evaluation.score for n in nodes if n.evaluation.score is not None)
    assert nodes[found.result].evaluation.score == best


def _ancestry(nodes, id_):  # type: ignore[no-untyped-def]
    while id_ is not None:
        yield id_
        id_ = nodes[id_].parent
