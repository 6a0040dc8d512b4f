"""A domain without machines: candidates are words; replies and scores come from tables."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Mapping, Sequence

from agentflow.errors import BudgetSpentError
from agentflow.search.elites.axes import Axis, Measurement
from agentflow.search.events import SearchEvent
from agentflow.search.node import Attempt, Evaluation, Node

ONE_KIND = (Measurement(Axis("kind", "", 0.0, 1.0, 1), 0.5),)
"""The measurements of words that are all of one kind."""


class Words:
    """Replies by label (a word, or None for an invalid one) and scores by word."""

    def __init__(
        self,
        replies: Mapping[str, str | None],
        scores: Mapping[str, float | None],
        budget: int | None = None,
        delays: random.Random | None = None,
    ) -> None:
        self.replies, self.scores = replies, scores
        self.budget, self.delays = budget, delays
        self.requests: list[tuple[str, int, int]] = []
        """(word, attempts requested, earlier attempts) of each request round."""
        self.rollouts: list[tuple[str, str]] = []
        """(word, label) of each evaluation."""
        self.events: list[SearchEvent] = []

    async def expand(
        self, node: Node[str], labels: Sequence[str], earlier: Sequence[Attempt[str]]
    ) -> list[Attempt[str]]:
        self.requests.append((node.candidate, len(labels), len(earlier)))
        if self.budget is not None:
            labels = labels[: self.budget]
            self.budget -= len(labels)
            if not labels:
                raise BudgetSpentError("no calls left")
        return list(await asyncio.gather(*(self._answer(label) for label in labels)))

    async def evaluate(self, candidate: str, label: str) -> Evaluation:
        self.rollouts.append((candidate, label))
        await self._wait()
        return Evaluation(True, self.scores[candidate], measurements=ONE_KIND)

    async def _answer(self, label: str) -> Attempt[str]:
        await self._wait()
        word = self.replies[label]
        return Attempt(label, word, "valid" if word else "refused")

    async def _wait(self) -> None:
        if self.delays is not None:
            await asyncio.sleep(self.delays.random() * 2e-3)


class Chance(Mapping[str, str | None]):
    """A reply for every label, drawn from the label alone; a third of them invalid."""

    def __init__(self, seed: int, words: int = 12) -> None:
        self.seed, self.words = seed, words

    def __getitem__(self, label: str) -> str | None:
        rng = random.Random(f"{self.seed}/{label}")
        return None if rng.random() < 1 / 3 else f"w{rng.randrange(self.words)}"

    def __iter__(self):  # type: ignore[no-untyped-def]
        raise TypeError("endless")

    def __len__(self) -> int:
        raise TypeError("endless")


def scores(seed: int, words: int = 12) -> dict[str, float | None]:
    """A score for every word; one in six has none."""
    rng = random.Random(f"{seed}/scores")
    drawn = {f"w{i}": round(rng.gauss(0, 10), 1) for i in range(words)}
    return {word: None if rng.random() < 1 / 6 else score for word, score in drawn.items()}
