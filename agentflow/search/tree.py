"""The search tree that all strategies share.

Nodes are numbered by attempt, not by arrival, so the tree does not depend on concurrency.
"""

from __future__ import annotations

import time
from collections.abc import Coroutine, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, Generic

from agentflow.errors import BudgetSpentError
from agentflow.search.concurrency import EvaluateOnce, run_concurrently
from agentflow.search.events import Expanded, Observer, Selected, Simulated
from agentflow.search.node import (
    Attempt,
    C,
    Evaluate,
    Evaluation,
    Expand,
    Node,
    SearchCost,
    SearchResult,
)
from agentflow.search.pareto import dominates, ranks


def is_better(new: Evaluation, old: Evaluation) -> bool:
    """Whether `new` is valid and has a higher reward than `old`; any valid one beats none.

    Among equal rewards, one that dominates the other is better.
    """
    if not new.valid or new.reward is None:
        return False
    if not old.valid or old.reward is None:
        return True
    if new.reward == old.reward:
        return dominates(new.objectives or (), old.objectives or ())
    return new.reward > old.reward


@dataclass(frozen=True)
class Growth(Generic[C]):
    """New children of one node, numbered but not evaluated yet."""

    parent: Node[C]
    round: int
    ids: tuple[int, ...]
    new: tuple[tuple[C, str], ...]
    """(candidate, label of the attempt that made it)."""


class SearchTree(Generic[C]):
    """The nodes of one search, by id; expanded one node at a time."""

    def __init__(
        self,
        root: C,
        evaluation: Evaluation,
        expand: Expand[C],
        evaluate: Evaluate[C],
        request_rounds: int,
        observe: Observer,
    ) -> None:
        """Start with an evaluated root; ask at most `request_rounds` times per expansion."""
        self.nodes: list[Node[C]] = []
        self.stopped = False
        self._cost = SearchCost()
        self._expand = expand
        self._evaluate = EvaluateOnce(evaluate, {root: evaluation})
        self._request_rounds = request_rounds
        self._observe = observe
        self._started = time.perf_counter()
        self._join([Node(0, root, None, evaluation)])
        self._next_id = 1

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

    def rounds(self, count: int) -> Iterator[int]:
        """Yield round numbers from 1 to `count`.

        Stop early when the budget has run out or no candidate can do better than the best.
        """
        return takewhile(
            lambda _: not (self.stopped or self.best().evaluation.perfect), range(1, count + 1)
        )

    async def grow(self, parent: Node[C], round_: int, width: int) -> list[Node[C]]:
        """Add up to `width` children to a node and evaluate them concurrently.

        If no attempt is valid, the parent's candidate becomes the only child.

        Returns:
            The children by id; empty only if the budget ran out before the first valid one.
        """
        attempts = await self.request(parent, round_, width, self._expand)
        fallback = not self.stopped and all(attempt.candidate is None for attempt in attempts)
        growth = self.number(parent, round_, attempts, fallback=fallback)
        return self.join(growth, await run_concurrently(self.evaluations(growth)))

    async def request(
        self, parent: Node[C], round_: int, width: int, expand: Expand[C]
    ) -> list[Attempt[C]]:
        """Ask until `width` attempts are valid, no request round is left or the budget is spent.

        The first round makes `width` attempts; each later one makes one per missing child and is
        given the earlier attempts. Attempts are numbered across rounds.
        """
        self._observe(Selected(round_, tuple(node.id for node in self.path(parent))))
        attempts: list[Attempt[C]] = []
        refused = False
        for _ in range(self._request_rounds):
            missing = width - sum(attempt.candidate is not None for attempt in attempts)
            if missing <= 0 or refused:
                break
            first = len(attempts) + 1
            prefix = f"round-{round_}/node-{parent.id}"
            labels = [f"{prefix}/try-{number}" for number in range(first, first + missing)]
            try:
                made = await expand(parent, labels, tuple(attempts))
            except BudgetSpentError:
                made = ()
            attempts += made
            refused = len(made) < missing
            self.stopped |= refused
        return attempts

    def number(
        self, parent: Node[C], round_: int, attempts: Sequence[Attempt[C]], *, fallback: bool
    ) -> Growth[C]:
        """Give the valid attempts their ids; with `fallback`, the parent's candidate as well."""
        new = [(item.candidate, item.label) for item in attempts if item.candidate is not None]
        self._cost.expansions += bool(attempts)
        self._cost.attempts += len(attempts)
        self._cost.valid += len(new)
        if fallback:
            new = [(parent.candidate, "")]
        ids = tuple(range(self._next_id, self._next_id + len(new)))
        self._next_id += len(new)
        self._observe(Expanded(round_, parent.id, tuple(attempts), ids, fallback))
        return Growth(parent, round_, ids, tuple(new))

    def evaluations(self, growth: Growth[C]) -> list[Coroutine[Any, Any, Evaluation]]:
        """The evaluations of new children, to be awaited in any order."""
        return [
            self._evaluate(candidate, f"round-{growth.round}/node-{id_}")
            for id_, (candidate, _) in zip(growth.ids, growth.new, strict=True)
        ]

    def join(self, growth: Growth[C], evaluations: Sequence[Evaluation]) -> list[Node[C]]:
        """Add evaluated children to the tree, in the order in which they were numbered."""
        children = [
            Node(id_, candidate, growth.parent.id, evaluation, label)
            for id_, (candidate, label), evaluation in zip(
                growth.ids, growth.new, evaluations, strict=True
            )
        ]
        self._join(children)
        growth.parent.children += growth.ids
        for child in children:
            self._observe(Simulated(growth.round, child))
        return children

    def _join(self, new: Sequence[Node[C]]) -> None:
        """Add nodes, and give each its reward.

        In a search for a Pareto front, the reward is 1 / the number of the front that the node is
        in, among all nodes so far: a graded form of the dominance reward, which is 1 for the first
        front and 0 for others (Wang and Sebag 2013, "Hypervolume indicator and dominance reward
        based multi-objective Monte-Carlo tree search", Machine Learning 92). Earlier nodes keep
        theirs, although new ones may push them to a later front: it has been backed up along their
        paths, and the totals there must stay sums of the rewards of nodes.
        """
        self.nodes += new
        compared = [node for node in self.nodes if node.evaluation.objectives is not None]
        fronts = ranks([node.evaluation.objectives or () for node in compared])
        front_of = {node.id: front for node, front in zip(compared, fronts, strict=True)}
        for node in new:
            front = front_of.get(node.id)
            node.reward = node.evaluation.reward if front is None else 1 / front

    def result(self, result: Node[C]) -> SearchResult[C]:
        """The outcome of the search, with `result` as the node that the strategy returns."""
        self._cost.seconds = time.perf_counter() - self._started
        self._cost.rollouts = self._evaluate.count
        return SearchResult(tuple(self.nodes), result.id, self.best().id, self._cost, self.stopped)
