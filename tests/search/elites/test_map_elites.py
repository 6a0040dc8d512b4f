"""The archive, and MAP-Elites over words: their lengths and first letters are their kinds."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agentflow.errors import UsageError
from agentflow.search.elites.archive import Archive, Filing
from agentflow.search.elites.axes import Axis, Measurement
from agentflow.search.elites.map_elites import map_elites
from agentflow.search.events import ArchiveOpened, Filed, Selected
from agentflow.search.node import Attempt, Evaluation, Node, SearchResult
from agentflow.search.settings import SearchSettings
from tests.search.domain import Chance, Words, scores

pytest.importorskip("ribs")

LENGTH = Axis("length", "letters", 0.0, 8.0, 4)
LETTER = Axis.of_categories("first letter", ("a", "b", "c"))


def judged(word: str, score: float | None) -> Evaluation:
    kinds = (Measurement(LENGTH, float(len(word))), Measurement(LETTER, "abc".find(word[0]) + 0.0))
    return Evaluation(True, score, measurements=kinds)


def node(id_: int, word: str, score: float | None) -> Node[str]:
    return Node(id_, word, None, judged(word, score))


def test_axes_describe_their_cells() -> None:
    assert [LENGTH.describe(cell) for cell in (0, 3)] == ["0 to 2 letters", "6 to 8 letters"]
    assert LETTER.describe(1) == "b"
    assert [Axis("wheels", "", -0.5, 3.5, 4).describe(cell) for cell in (0, 3)] == ["0", "3"]
    assert (LETTER.low, LETTER.high, LETTER.cells) == (-0.5, 2.5, 3)


def test_a_cell_keeps_its_best_node() -> None:
    archive = Archive[str]((LENGTH, LETTER))
    first, equal, better = node(0, "bat", 2.0), node(1, "bag", 2.0), node(2, "ban", 3.0)
    assert archive.offer(first) == Filing((1, 1), "new")
    assert archive.offer(equal) == Filing((1, 1), "worse")
    assert archive.elites == {(1, 1): first}
    assert archive.offer(better) == Filing((1, 1), "better")
    assert archive.offer(node(3, "c", -1.0)) == Filing((0, 2), "new")
    assert [item.id for item in archive.elites.values()] == [3, 2]


def test_values_outside_an_axis_count_for_its_outer_cells() -> None:
    archive = Archive[str]((LENGTH, LETTER))
    assert archive.offer(node(0, "a" * 30, 1.0)).cell == (3, 0)
    assert archive.offer(node(1, "a" * 8, 1.0)).cell == (3, 0)
    assert archive.offer(node(2, "aa", 1.0)).cell == (1, 0)


@pytest.mark.parametrize(
    "evaluation",
    [
        judged("bat", None),
        replace(judged("bat", 1.0), valid=False),
        replace(
            judged("bat", 1.0), measurements=(Measurement(LENGTH, 3.0), Measurement(LETTER, None))
        ),
    ],
)
def test_what_is_unmeasured_belongs_to_no_cell(evaluation: Evaluation) -> None:
    archive = Archive[str]((LENGTH, LETTER))
    assert archive.offer(Node(0, "bat", None, evaluation)) == Filing(None, "unmeasured")
    assert archive.elites == {}


def test_empty_neighbours_are_one_step_away_or_of_another_category() -> None:
    archive = Archive[str]((LENGTH, LETTER))
    archive.offer(node(0, "a", 1.0))
    assert archive.empty_neighbours((0, 0)) == [(1, 0), (0, 1), (0, 2)]
    archive.offer(node(1, "b", 1.0))
    assert archive.empty_neighbours((0, 0)) == [(1, 0), (0, 2)]
    assert archive.empty_neighbours((2, 1)) == [(1, 1), (3, 1), (2, 0), (2, 2)]


def test_an_archive_needs_axes() -> None:
    with pytest.raises(UsageError, match="measured on at least one axis"):
        Archive[str](())


class Kinds(Words):
    """Words with measurements."""

    async def evaluate(self, candidate: str, label: str) -> Evaluation:
        found = await super().evaluate(candidate, label)
        return judged(candidate, found.score)


async def run(words: Words, numbers: SearchSettings, root: str = "a") -> SearchResult[str]:
    start = judged(root, 1.0)
    return await map_elites(root, start, words.expand, words.evaluate, numbers, words.events.append)


async def test_golden_search() -> None:
    """Three rounds, width 2. The root a scores 1.

    Round 1  a. 1 = b (5.0, new cell), 2 = c (7.0, new cell).
    Round 2  b and c have not been expanded: c scores higher. 3 = cc (0.0, new), 4 = b (no score).
    Round 3  b and cc are left: b. 5 = ba (9.0, new), 6 = bee (2.0, worse than ba).
    """
    replies = {
        "round-1/node-0/try-1": "b",
        "round-1/node-0/try-2": "c",
        "round-2/node-2/try-1": "cc",
        "round-2/node-2/try-2": "bb",
        "round-3/node-1/try-1": "ba",
        "round-3/node-1/try-2": "bee",
    }
    known = {"b": 5.0, "c": 7.0, "cc": 0.0, "bb": None, "ba": 9.0, "bee": 2.0}
    words = Kinds(replies, known)
    found = await run(words, SearchSettings(rounds=3, width=2, request_rounds=1))
    assert [item.path for item in words.events if isinstance(item, Selected)] == [
        (0,),
        (0, 2),
        (0, 1),
    ]
    assert isinstance(words.events[0], ArchiveOpened)
    assert words.events[0].axes == (LENGTH, LETTER)
    filed = [item for item in words.events if isinstance(item, Filed)]
    assert [
        (item.round, item.node.id, item.filing.cell, item.filing.outcome) for item in filed
    ] == [
        (0, 0, (0, 0), "new"),
        (1, 1, (0, 1), "new"),
        (1, 2, (0, 2), "new"),
        (2, 3, (1, 2), "new"),
        (2, 4, None, "unmeasured"),
        (3, 5, (1, 1), "new"),
        (3, 6, (1, 1), "worse"),
    ]
    assert (found.result, found.best, found.cost.rollouts) == (5, 5, 6)


async def test_without_an_elite_the_best_node_is_expanded() -> None:
    words = Kinds({"round-1/node-0/try-1": "b"}, {"b": 1.0})
    start = Evaluation(True, None, measurements=judged("a", None).measurements)
    numbers = SearchSettings(rounds=1, width=1)
    found = await map_elites("a", start, words.expand, words.evaluate, numbers, words.events.append)
    assert [item.candidate for item in found.nodes] == ["a", "b"]


async def test_expand_can_read_a_given_archive() -> None:
    archive = Archive[str]((LENGTH, LETTER))
    seen: list[int] = []

    async def expand(
        _node: Node[str], labels: Sequence[str], _earlier: Sequence[Attempt[str]]
    ) -> list[Attempt[str]]:
        seen.append(len(archive.elites))
        return [Attempt(label, "abc"[len(seen)], "") for label in labels]

    words = Kinds({}, {"b": 1.0, "c": 1.0})
    numbers = SearchSettings(rounds=2, width=1)
    await map_elites("a", judged("a", 1.0), expand, words.evaluate, numbers, archive=archive)
    assert seen == [1, 2]


@pytest.mark.slow
@given(st.integers(0, 10_000))
async def test_concurrency_changes_nothing(seed: int) -> None:
    """Replies that arrive in any order make the same tree, archive and events."""
    numbers = SearchSettings(rounds=4, width=3, request_rounds=2)

    async def search(delays: random.Random | None) -> tuple[SearchResult[str], Words]:
        table = {
            word.replace("w", "abc"[int(word[1:]) % 3]): score
            for word, score in scores(seed).items()
        }
        words = Kinds(Named(seed), table, delays=delays)
        return await run(words, numbers), words

    (one, first), (other, second) = await search(None), await search(random.Random(seed))
    assert one == other
    assert first.events == second.events


class Named(Chance):
    """The words of `Chance`, with a first letter of the alphabet's first three."""

    def __getitem__(self, label: str) -> str | None:
        word = super().__getitem__(label)
        return word and word.replace("w", "abc"[int(word[1:]) % 3])
