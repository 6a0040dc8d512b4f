"""Owns best-of-N search: refine the best so far N times, keep the best if it improves."""

from __future__ import annotations

from agentflow.search.events import Observer, Selected, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import Tree


async def best_of_n(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
) -> SearchResult[C]:
    """Per round, `settings.width` children of the best node so far; the result is the best.

    Only a strictly better child takes over, so a node may be expanded again. Arguments as for
    `mcts`; `settings.ucb` is not used.
    """
    tree = Tree(root, evaluation, expand, evaluate, settings.waves, observe)
    for round_ in range(1, settings.rounds + 1):
        best = tree.best()
        observe(Selected(round_, tuple(node.id for node in tree.path(best))))
        await tree.grow(best, round_, settings.width)
        if tree.stopped:
            break
    return tree.found(tree.best())
