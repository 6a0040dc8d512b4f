"""Rewards of replies, judged in worker processes while the model still writes others."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from math import log1p
from types import MappingProxyType
from typing import NamedTuple

from agentflow.env.mechanism import classify
from agentflow.env.tasks.registry import FAMILIES, get_level
from agentflow.machine import Machine
from agentflow.rewards import Reward, Sample, Scorer

RewardFunction = Callable[[str, Reward], float | None]
"""Takes the level's name and the simulated reply. None means that there is no reward, after a
time-out or crash: the reply says nothing and is left out of its group."""


def performance(task: str, reward: Reward) -> float | None:
    """The performance of a valid machine, 0 without one.

    It is the term that the family names as its `performance`, else the score over the level's good
    score.
    """
    if reward.value is None:
        return None
    level = get_level(task).file
    term = FAMILIES[level.family].performance
    if term is not None:
        return float(reward.rollout.terms.get(term) or 0.0)
    return reward.value / level.good


def shaped(task: str, reward: Reward) -> float | None:  # noqa: ARG001 - as all rewards
    """0.1 parsed + 0.2 spatially valid + 0.7 valid + 0.3 ln(1 + score).

    For models that rarely write a valid machine: every step towards one counts, and the logarithm
    keeps a single far throw from outweighing them. The weights were found by trial with a model
    of 1.9 million parameters; with raw scores, its share of valid machines collapsed.
    """
    if reward.value is None:
        return None
    steps = 0.1 * reward.parsed + 0.2 * bool(reward.spatial) + 0.7 * reward.valid
    return steps + 0.3 * log1p(max(0.0, reward.value))


REWARDS: Mapping[str, RewardFunction] = MappingProxyType(
    {"performance": performance, "shaped": shaped}
)


REMEMBERED = 20_000
"""Replies whose rewards are kept in memory."""


class Judged(NamedTuple):
    """What simulation says about a reply."""

    reward: float | None
    """None after a time-out or crash."""
    score: float | None
    """In the unit of the task; as `reward`."""
    parsed: bool
    spatial: bool
    valid: bool
    machine: Machine | None
    mechanism: str | None = None
    """The class of a machine that scores; None for others."""


LOST = Judged(None, None, False, False, False, None)
"""A design whose simulations failed before it was submitted."""


class Judging:
    """Rewards of replies. Identical replies to a task are simulated once, unless it failed."""

    def __init__(
        self, scorer: Scorer, reward: RewardFunction, engine: str, remembered: int = REMEMBERED
    ) -> None:
        """`remembered`: replies whose rewards are kept for later steps."""
        self._scorer, self._reward, self._engine = scorer, reward, engine
        self._remembered = remembered
        self._known: dict[tuple[str, str], Judged] = {}
        self._pending: dict[tuple[str, str], Future[Reward]] = {}

    def hand_over(self, tasks: Sequence[str], texts: Sequence[str]) -> None:
        """Begin to simulate the machines of replies; return at once."""
        for task, text in zip(tasks, texts, strict=True):
            if (task, text) not in self._known and (task, text) not in self._pending:
                sample = Sample(task, text, engine=self._engine)
                self._pending[task, text] = self._scorer.submit(sample)

    def collect(self, tasks: Sequence[str], texts: Sequence[str]) -> list[Judged]:
        """Wait for the rewards of replies, handed over before or not.

        Raises:
            UsageError: A task or engine does not exist.
        """
        self.hand_over(tasks, texts)
        replies = list(zip(tasks, texts, strict=True))
        found = {reply: self._wait_for(reply) for reply in dict.fromkeys(replies)}
        for reply, count in Counter(replies).items():
            if found[reply].reward is None and count > 1:  # a second chance for all of them
                self.hand_over(*([part] for part in reply))
                found[reply] = self._wait_for(reply)
        while len(self._known) > self._remembered:  # not before: this step may need the oldest
            self._known.pop(next(iter(self._known)))
        return [found[reply] for reply in replies]

    def _wait_for(self, reply: tuple[str, str]) -> Judged:
        if reply in self._known:
            return self._known[reply]
        made = self._pending.pop(reply).result()
        judged = Judged(
            reward=self._reward(reply[0], made),
            score=made.value,
            parsed=made.parsed,
            spatial=bool(made.spatial),
            valid=made.valid,
            machine=made.machine,
            mechanism=_class_of(made),
        )
        if judged.reward is not None:
            self._known[reply] = judged
        return judged


def _class_of(reward: Reward) -> str | None:
    if reward.machine is None or not reward.valid or not reward.value or reward.value < 0:
        return None
    found = classify(reward.machine, reward.rollout)
    return None if found is None else str(found)
