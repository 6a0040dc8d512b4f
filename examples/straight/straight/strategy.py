"""A search strategy: it often goes back to the first machine."""

from __future__ import annotations

from agentflow.search.events import Observer, ignore
from agentflow.search.node import C, Evaluate, Evaluation, Expand, SearchResult
from agentflow.search.settings import SearchSettings
from agentflow.search.tree import SearchTree


async def restarts(
    root: C,
    evaluation: Evaluation,
    expand: Expand[C],
    evaluate: Evaluate[C],
    settings: SearchSettings,
    observe: Observer = ignore,
) -> SearchResult[C]:
    """Refine the best machine in odd rounds, and the first one in even rounds."""
    tree = SearchTree(root, evaluation, expand, evaluate, settings.request_rounds, observe)
    for round_ in tree.rounds(settings.rounds):
        parent = tree.best() if round_ % 2 else tree.nodes[0]
        await tree.grow(parent, round_, settings.width)
    return tree.result(tree.best())
