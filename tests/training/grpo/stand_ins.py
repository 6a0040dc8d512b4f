"""Rewards from a table in place of simulations, for tests of what is done with them."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future

from agentflow.env.rollout import Feedback, Rollout
from agentflow.rewards import Reward
from agentflow.rewards.scoring import Sample


class TableScorer:
    """Submits like `Scorer`; the score of a text is in the table, and None is a crash."""

    def __init__(self, scores: Mapping[str, float | None]) -> None:
        self._scores = scores
        self.submitted: list[str] = []

    def submit(self, sample: Sample) -> Future[Reward]:
        self.submitted.append(sample.text)
        future: Future[Reward] = Future()
        future.set_result(self._reward(self._scores[sample.text]))
        return future

    def _reward(self, score: float | None) -> Reward:
        status = "ok" if score is not None else "crashed"
        rollout = Rollout(status, score, Feedback("", {}), {"distance": score})
        return Reward(score, True, True, True, status, (), None, rollout)
