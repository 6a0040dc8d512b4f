"""Best-of-N search: expand the best candidate so far in every round."""

from __future__ import annotations

from agentflow.search.events import Observer, Selected, ignore
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
    tree = SearchTree(root, evaluation, expand, evaluate, settings.waves, observe)
    for round_ in range(1, settings.rounds + 1):
        best = tree.best()
        observe(Selected(round_, tuple(node.id for node in tree.path(best))))
        await tree.grow(best, round_, settings.width)
        if tree.stopped:
            break
    return tree.result(tree.best())
