"""Rewards from a table in place of simulations, for tests of what is done with them."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from types import MappingProxyType

from agentflow.env.rollout import Feedback, Rollout
from agentflow.machine import Machine
from agentflow.rewards import Reward, Sample


class TableScorer:
    """Submits like `Scorer`; the score of a text is in the table, and None is a crash.

    A list holds the scores of one simulation after the other.
    """

    def __init__(
        self,
        scores: Mapping[str, float | list[float | None] | None],
        machines: Mapping[str, Machine] = MappingProxyType({}),
    ) -> None:
        """`machines`: those in replies that have one."""
        self._scores, self._machines = scores, machines
        self.submitted: list[str] = []

    def submit(self, sample: Sample) -> Future[Reward]:
        self.submitted.append(sample.text)
        future: Future[Reward] = Future()
        future.set_result(self._reward(sample.text))
        return future

    def _reward(self, text: str) -> Reward:
        score, machine = self._scores[text], self._machines.get(text)
        if isinstance(score, list):
            score = score.pop(0)
        status = "ok" if score is not None else "crashed"
        rollout = Rollout(status, score, Feedback("", {}), {"distance": score})
        return Reward(score, True, True, True, status, (), machine, rollout)
