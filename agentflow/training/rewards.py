"""Rewards of replies for reinforcement learning, from what the simulation found.

Each takes the level's name and the simulated reply. None means that there is no reward, after a
time-out or crash: the reply says nothing and is left out of its group.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import log1p
from types import MappingProxyType

from agentflow.env.tasks.registry import get_level
from agentflow.rewards import Reward

RewardFunction = Callable[[str, Reward], float | None]

TERMS: Mapping[str, str] = MappingProxyType({"movement": "distance", "throwing": "rl"})
"""Family -> the term of its score that is the performance.

Movement: greatest distance of the root along the target, m. Throwing: greatest height times the
distance of the throw, m2, and 0 unless the boulder rises above 3 m.
"""


def performance(task: str, reward: Reward) -> float | None:
    """The performance of a valid machine, 0 without one.

    For families without a term in `TERMS`, the score over the level's good score.
    """
    if reward.value is None:
        return None
    level = get_level(task).file
    if level.family in TERMS:
        return float(reward.rollout.terms.get(TERMS[level.family]) or 0.0)
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
