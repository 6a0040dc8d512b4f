"""Selection by upper confidence bound (UCB1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from agentflow.search.node import C, Node
from agentflow.search.settings import UcbSettings


def reward_range(nodes: Sequence[Node[C]], settings: UcbSettings) -> tuple[float, float]:
    """Offset to subtract from a reward and number to divide it by.

    With `scale: minmax`, the lowest reward of the current tree, including the root, and the spread
    of its rewards (1 if they are all equal). With `none`, (0, 1).
    """
    rewards = [node.reward for node in nodes if node.reward is not None]
    if settings.scale == "none" or not rewards:
        return 0.0, 1.0
    return min(rewards), (max(rewards) - min(rewards)) or 1.0


def ucb(
    parent_visits: int, visits: int, total: float, scale: tuple[float, float], c: float
) -> float:
    """mean + c * sqrt(ln(parent visits) / visits); infinite for unvisited nodes."""
    if visits == 0:
        return math.inf
    low, spread = scale
    return (total / visits - low) / spread + c * math.sqrt(math.log(parent_visits) / visits)


def select(nodes: Sequence[Node[C]], settings: UcbSettings) -> list[Node[C]]:
    """The path from the root to the leaf to expand; ties go to the lowest node id."""
    scale = reward_range(nodes, settings)
    path = [nodes[0]]
    while path[-1].children:
        parent, children = path[-1], [nodes[id_] for id_ in path[-1].children]
        bounds = [
            ucb(parent.visits, child.visits, child.total, scale, settings.c) for child in children
        ]
        path.append(children[bounds.index(max(bounds))])
    return path
