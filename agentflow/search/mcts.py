"""MCTS-style search: select by upper confidence bound (UCB1), expand, evaluate, back up."""

from __future__ import annotations

import math
from collections.abc import Sequence

from agentflow.search.events import BackedUp, Observer, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, Node, SearchResult
from agentflow.search.settings import SearchSettings, UcbSettings
from agentflow.search.tree import SearchTree


async def mcts(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
) -> SearchResult[C]:
    """Search for `settings.rounds` rounds; return the best candidate in the tree.

    Evaluations without a score (infrastructure failures) are not backed up: the node stays
    unvisited, and unvisited nodes are selected first. The root's own evaluation is not a visit.

    Args:
        root: Candidate to start from.
        evaluation: Evaluation of the root.
        expand: Runs one round of attempts.
        evaluate: Evaluates a candidate; called once per distinct candidate.
        settings: Rounds, width, request rounds and `ucb`.
        observe: Called with every event, in an order that does not depend on concurrency.
    """
    tree = SearchTree(root, evaluation, expand, evaluate, settings.request_rounds, observe)
    for round_ in tree.rounds(settings.rounds):
        leaf = select(tree.nodes, settings.ucb)[-1]
        for child in await tree.grow(leaf, round_, settings.width):
            _back_up(tree, child, round_, observe)
    return tree.result(tree.best())


def _back_up(tree: SearchTree[C], child: Node[C], round_: int, observe: Observer) -> None:
    reward = child.reward
    if reward is None:
        return
    path = tree.path(child)
    for node in path:
        node.visits += 1
        node.total += reward
    observe(BackedUp(round_, tuple(node.id for node in path), reward))


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
