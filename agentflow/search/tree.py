"""Owns the growing tree that all strategies share: its nodes, its bookkeeping, its best.

Replies and rollouts may come back in any order: nodes are numbered by attempt, not by arrival.
"""

from __future__ import annotations

import time
from typing import Generic

from agentflow.search.concurrency import EvaluateOnce, run_concurrently
from agentflow.search.events import Expanded, Observer, Simulated
from agentflow.search.expansion import Expansion, expand_node
from agentflow.search.node import C, Evaluate, Evaluation, Expand, Node, SearchCost, SearchResult


def is_better(new: Evaluation, old: Evaluation) -> bool:
    """Whether `new` is a valid, scored result above `old`; anything scored beats nothing."""
    if not new.valid or new.score is None:
        return False
    return not old.valid or old.score is None or new.score > old.score


class Tree(Generic[C]):
    """Nodes by id, and how to grow them. One search, one tree, one expansion at a time."""

    def __init__(
        self,
        root: C,
        evaluation: Evaluation,
        expand: Expand[C],
        evaluate: Evaluate[C],
        waves: int,
        observe: Observer,
    ) -> None:
        """Start with an evaluated root; `waves` is the most waves per expansion."""
        self.nodes = [Node(0, root, None, evaluation)]
        self.stopped = False
        """Whether the budget ran out: no further growth."""
        self._cost = SearchCost()
        self._expand = expand
        self._evaluate = EvaluateOnce(evaluate, {root: evaluation})
        self._waves = waves
        self._observe = observe
        self._started = time.perf_counter()

    def path(self, node: Node[C]) -> list[Node[C]]:
        """The nodes from the root to `node`, both included."""
        path = [node]
        while path[-1].parent is not None:
            path.append(self.nodes[path[-1].parent])
        return path[::-1]

    def best(self) -> Node[C]:
        """The best valid node; the lower id among equals; the first when none has a score."""
        first, *others = self.nodes
        for node in others:
            if is_better(node.evaluation, first.evaluation):
                first = node
        return first

    async def grow(self, parent: Node[C], round_: int, width: int) -> list[Node[C]]:
        """Expand a node, evaluate all its new children at once, and add them to the tree.

        Returns:
            The children by id; empty only when the budget ran out before the first valid one.
        """
        prefix = f"round-{round_}/node-{parent.id}"
        expansion = await expand_node(parent, self._expand, prefix, width, self._waves)
        ids = tuple(range(len(self.nodes), len(self.nodes) + len(expansion.children)))
        self._count(expansion)
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

    def found(self, result: Node[C]) -> SearchResult[C]:
        """Close the books with `result` as the strategy's answer."""
        self._cost.seconds = time.perf_counter() - self._started
        self._cost.rollouts = self._evaluate.count
        return SearchResult(tuple(self.nodes), result.id, self.best().id, self._cost, self.stopped)

    def _count(self, expansion: Expansion[C]) -> None:
        self.stopped = expansion.stopped
        self._cost.expansions += bool(expansion.attempts)
        self._cost.attempts += len(expansion.attempts)
        self._cost.valid += sum(item.candidate is not None for item in expansion.attempts)
