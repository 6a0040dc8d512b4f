"""MCTS-style search: select by UCB, expand, evaluate every child, back up."""

from __future__ import annotations

from agentflow.search.events import BackedUp, Observer, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, Node, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import SearchTree
from agentflow.search.ucb import select


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
        expand: Runs one wave of attempts.
        evaluate: Evaluates a candidate; called once per distinct candidate.
        settings: Rounds, width, waves and `ucb`.
        observe: Called with every event, in an order that does not depend on concurrency.
    """
    tree = SearchTree(root, evaluation, expand, evaluate, settings.waves, observe)
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
