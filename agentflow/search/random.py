"""Random search: expand the last candidate, whether or not it improved."""

from __future__ import annotations

from agentflow.search.events import Observer, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import SearchTree


async def random(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
) -> SearchResult[C]:
    """Each round, expand the last node into one child; return the last node.

    Arguments as for `mcts`; `settings.width` and `settings.ucb` are not used.
    """
    tree = SearchTree(root, evaluation, expand, evaluate, settings.request_rounds, observe)
    for round_ in tree.rounds(settings.rounds):
        await tree.grow(tree.nodes[-1], round_, width=1)
    return tree.result(tree.nodes[-1])
