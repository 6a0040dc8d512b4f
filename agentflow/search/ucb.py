"""Owns the upper confidence bound by which MCTS-style search chooses among siblings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from agentflow.search.node import C, Node
from agentflow.search.settings import UcbSettings


def reward_range(nodes: Sequence[Node[C]], settings: UcbSettings) -> tuple[float, float]:
    """What to subtract from a reward and what to divide it by.

    With `scale: minmax`, least reward and spread of the tree so far, root included; a tree of
    equal rewards scales to 0. With `none`, (0, 1).
    """
    scores = [node.evaluation.score for node in nodes if node.evaluation.score is not None]
    if settings.scale == "none" or not scores:
        return 0.0, 1.0
    return min(scores), (max(scores) - min(scores)) or 1.0


def bound(
    parent_visits: int, visits: int, total: float, scale: tuple[float, float], c: float
) -> float:
    """mean + c * sqrt(ln(parent visits) / visits), infinite for the unvisited (spec 5.1)."""
    if visits == 0:
        return math.inf
    low, spread = scale
    return (total / visits - low) / spread + c * math.sqrt(math.log(parent_visits) / visits)


def select(nodes: Sequence[Node[C]], settings: UcbSettings) -> list[Node[C]]:
    """The path from the root to the leaf to expand; ties go to the lower node id."""
    scale = reward_range(nodes, settings)
    path = [nodes[0]]
    while path[-1].children:
        path.append(_choose(nodes, path[-1], scale, settings.c))
    return path


def _choose(
    nodes: Sequence[Node[C]], parent: Node[C], scale: tuple[float, float], c: float
) -> Node[C]:
    def rank(child: Node[C]) -> tuple[float, int]:
        return bound(parent.visits, child.visits, child.total, scale, c), -child.id

    return max((nodes[id_] for id_ in parent.children), key=rank)
