"""The search tree that all strategies share.

Nodes are numbered by attempt, not by arrival, so the tree does not depend on concurrency.
"""

from __future__ import annotations

import time
from typing import Generic

from agentflow.search.concurrency import EvaluateOnce, run_concurrently
from agentflow.search.events import Expanded, Observer, Simulated
from agentflow.search.expansion import Expansion, expand_node
from agentflow.search.node import C, Evaluate, Evaluation, Expand, Node, SearchCost, SearchResult


def is_better(new: Evaluation, old: Evaluation) -> bool:
    """Whether `new` is valid and scores higher than `old`; any valid score beats none."""
    if not new.valid or new.score is None:
        return False
    return not old.valid or old.score is None or new.score > old.score


class SearchTree(Generic[C]):
    """The nodes of one search, by id; expanded one node at a time."""

    def __init__(
        self,
        root: C,
        evaluation: Evaluation,
        expand: Expand[C],
        evaluate: Evaluate[C],
        waves: int,
        observe: Observer,
    ) -> None:
        """Start with an evaluated root; make at most `waves` waves of attempts per expansion."""
        self.nodes = [Node(0, root, None, evaluation)]
        self.stopped = False
        """Whether the budget has run out."""
        self._cost = SearchCost()
        self._expand = expand
        self._evaluate = EvaluateOnce(evaluate, {root: evaluation})
        self._waves = waves
        self._observe = observe
        self._started = time.perf_counter()

    def path(self, node: Node[C]) -> list[Node[C]]:
        """The nodes from the root to `node`, inclusive."""
        path = [node]
        while path[-1].parent is not None:
            path.append(self.nodes[path[-1].parent])
        return path[::-1]

    def best(self) -> Node[C]:
        """The best valid node, the lowest id among equals; the root if no node has a score."""
        best = self.nodes[0]
        for node in self.nodes[1:]:
            if is_better(node.evaluation, best.evaluation):
                best = node
        return best

    async def grow(self, parent: Node[C], round_: int, width: int) -> list[Node[C]]:
        """Expand a node, evaluate its new children concurrently, and add them to the tree.

        Returns:
            The children by id; empty only if the budget ran out before the first valid one.
        """
        prefix = f"round-{round_}/node-{parent.id}"
        expansion = await expand_node(parent, self._expand, prefix, width, self._waves)
        ids = tuple(range(len(self.nodes), len(self.nodes) + len(expansion.children)))
        self._record_cost(expansion)
        self._observe(Expanded(round_, parent.id, expansion.attempts, ids, expansion.fallback))
        evaluations = await run_concurrently(
            self._evaluate(candidate, f"round-{round_}/node-{id_}")
            for id_, (candidate, _) in zip(ids, expansion.children, strict=True)
        )
        children = [
            Node(id_, candidate, parent.id, evaluation, label)
            for id_, (candidate, label), evaluation in zip(
                ids, expansion.children, evaluations, strict=True
            )
        ]
        self.nodes += children
        parent.children += ids
        for child in children:
            self._observe(Simulated(round_, child))
        return children

    def result(self, result: Node[C]) -> SearchResult[C]:
        """The outcome of the search, with `result` as the node that the strategy returns."""
        self._cost.seconds = time.perf_counter() - self._started
        self._cost.rollouts = self._evaluate.count
        return SearchResult(tuple(self.nodes), result.id, self.best().id, self._cost, self.stopped)

    def _record_cost(self, expansion: Expansion[C]) -> None:
        self.stopped = expansion.stopped
        self._cost.expansions += bool(expansion.attempts)
        self._cost.attempts += len(expansion.attempts)
        self._cost.valid += sum(item.candidate is not None for item in expansion.attempts)
