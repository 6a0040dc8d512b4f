"""Owns MCTS-style search: select by UCB, expand, simulate every child, back up (spec 5.1)."""

from __future__ import annotations

from agentflow.search.events import BackedUp, Observer, Selected, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, Node, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import Tree
from agentflow.search.ucb import select


async def mcts(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
) -> SearchResult[C]:
    """Search for `settings.rounds` rounds; the result is the best candidate of the tree.

    Results without a score (the computer failed) are left out of the back-up. Such a node stays
    unvisited, and unvisited nodes are selected first. The root's own score is no visit of it.

    Args:
        root: Where to start.
        evaluation: The root's.
        expand: Runs one wave of attempts.
        evaluate: Tries a candidate; asked once per distinct candidate.
        settings: Rounds, width, waves and `ucb`.
        observe: Told everything, in an order that concurrency does not change.
    """
    tree = Tree(root, evaluation, expand, evaluate, settings.waves, observe)
    for round_ in range(1, settings.rounds + 1):
        path = select(tree.nodes, settings.ucb)
        observe(Selected(round_, tuple(node.id for node in path)))
        for child in await tree.grow(path[-1], round_, settings.width):
            _back_up(tree, child, round_, observe)
        if tree.stopped:
            break
    return tree.found(tree.best())


def _back_up(tree: Tree[C], child: Node[C], round_: int, observe: Observer) -> None:
    reward = child.evaluation.score
    if reward is None:
        return
    path = tree.path(child)
    for node in path:
        node.visits += 1
        node.total += reward
    observe(BackedUp(round_, tuple(node.id for node in path), reward))
