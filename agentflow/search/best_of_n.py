"""Best-of-N search: expand the best candidate so far in every round."""

from __future__ import annotations

from agentflow.search.events import Observer, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import SearchTree


async def best_of_n(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
) -> SearchResult[C]:
    """Each round, expand the best node so far into `settings.width` children; return the best.

    Only a strictly better child becomes the best, so a node may be expanded more than once.
    Arguments as for `mcts`; `settings.ucb` is not used.
    """
    tree = SearchTree(root, evaluation, expand, evaluate, settings.request_rounds, observe)
    for round_ in tree.rounds(settings.rounds):
        await tree.grow(tree.best(), round_, settings.width)
    return tree.result(tree.best())
