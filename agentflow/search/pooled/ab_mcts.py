"""AB-MCTS-A: adaptive branching by Thompson sampling (Inoue et al. 2025, arXiv 2503.04412).

At every node, from the root on, whose children are the first candidates, the search draws from two
posteriors of scores: of new children, and of all that lies deeper. If the first draw is higher, it
makes a new child (wider); otherwise it goes on to the child with the highest draw from its own
posterior (deeper). Who makes the child is drawn in the same way.

Posteriors and order of draws are those of the reference implementation (TreeQuest 0.3, class
ABMCTSA, Apache 2.0). It takes scores from 0 to 1; here the scores of the pool are scaled to that
range, as those of `mcts` are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from random import Random
from typing import Any, NamedTuple

from agentflow.search.node import Node
from agentflow.search.pooled.pool import Branch, Choice, Pool, PooledStrategy

MEAN, KAPPA, NU, TAU_SQUARED = 0.0, 1.0, 1.0, 0.1
"""The prior of TreeQuest, a normal-inverse-chi-squared distribution of scores from 0 to 1."""


class Posterior(NamedTuple):
    """What is known about the mean of some scores (Murphy, Probabilistic Machine Learning:
    Advanced Topics, 3.4.3.3)."""

    mean: float
    kappa: float
    nu: float
    tau_squared: float

    @classmethod
    def given(cls, scores: Sequence[float]) -> Posterior:
        """After these observations."""
        count = len(scores)
        if not count:
            return cls(MEAN, KAPPA, NU, TAU_SQUARED)
        average = sum(scores) / count
        squares = sum((score - average) ** 2 for score in scores)
        kappa, nu = KAPPA + count, NU + count
        apart = count * KAPPA * (MEAN - average) ** 2 / kappa
        return cls(
            (KAPPA * MEAN + count * average) / kappa,
            kappa,
            nu,
            (NU * TAU_SQUARED + squares + apart) / nu,
        )

    def draw(self, rng: Random) -> float:
        """A mean drawn from it."""
        variance = self.nu * self.tau_squared / 2 / rng.gammavariate(self.nu / 2, 1.0)
        return rng.gauss(self.mean, math.sqrt(variance / self.kappa))


class AdaptiveBranching(PooledStrategy):
    """Chooses as AB-MCTS-A does."""

    def choose(self, pool: Pool[Any], rng: Random) -> Choice | None:
        """Descend from the root until a new child is drawn, or a node without children is met."""
        scores = Scores(pool)
        branches = [each for each in pool.branches if each.tree or not pool.is_full]
        begun = [scores.of_branch(branch) for branch in branches]
        if _goes_wider(begun, rng) and not pool.is_full:
            return Choice(draw_arm(scores, pool.openers, rng))
        if not begun:
            return None
        branch = branches[_draw_best([[own, *deep] for own, deep in begun], rng)]
        if branch.tree is None or not pool.arms:
            return None if pool.is_full else Choice(draw_arm(scores, pool.openers, rng))
        node = branch.tree.nodes[0]
        while node.children:
            children = [branch.tree.nodes[id_] for id_ in node.children]
            found = [(scores.of(child), scores.below(branch, child)) for child in children]
            if _goes_wider(found, rng):
                return Choice(draw_arm(scores, pool.arms, rng), branch.number, node.id)
            node = children[_draw_best([[own, *deep] for own, deep in found], rng)]
        _goes_wider([], rng)  # the reference draws here as well
        return Choice(draw_arm(scores, pool.arms, rng), branch.number, node.id)


def _goes_wider(children: Sequence[tuple[float, Sequence[float]]], rng: Random) -> bool:
    """Whether to make a new child, given the scores of the others and of all below each."""
    wider = Posterior.given([own for own, _ in children]).draw(rng)
    beyond = Posterior.given([score for _, deep in children for score in deep]).draw(rng)
    return wider >= beyond or not children


def _draw_best(of: Iterable[Sequence[float]], rng: Random) -> int:
    """The number of the highest draw from the posteriors of some scores."""
    drawn = [Posterior.given(scores).draw(rng) for scores in of]
    return drawn.index(max(drawn))


class Scores:
    """The rewards of a pool, scaled to 0 to 1; what has none counts as the lowest."""

    def __init__(self, pool: Pool[Any]) -> None:
        rewards = [node.reward for _, node in pool.nodes if node.reward is not None]
        self._low = min(rewards, default=0.0)
        self._spread = (max(rewards, default=0.0) - self._low) or 1.0
        self.by_arm: dict[str, list[float]] = {}
        """Who made them -> scores."""
        for branch in pool.branches:
            if branch.tree is None:
                self.by_arm.setdefault(branch.arm, []).append(0.0)
        for branch, node in pool.nodes:
            self.by_arm.setdefault(branch.arms[node.id], []).append(self.of(node))

    def of(self, node: Node[Any]) -> float:
        """The score of one node."""
        return 0.0 if node.reward is None else (node.reward - self._low) / self._spread

    def below(self, branch: Branch[Any], node: Node[Any]) -> list[float]:
        """All that was made from a node, by id."""
        assert branch.tree is not None
        inside, found = {node.id}, []
        for other in branch.tree.nodes[node.id + 1 :]:
            if other.parent in inside:
                inside.add(other.id)
                found.append(self.of(other))
        return found

    def of_branch(self, branch: Branch[Any]) -> tuple[float, list[float]]:
        """The score of the first candidate, and those of all that was made from it."""
        if branch.tree is None:
            return 0.0, []
        root = branch.tree.nodes[0]
        return self.of(root), self.below(branch, root)


def draw_arm(scores: Scores, arms: Sequence[str], rng: Random) -> str:
    """Who makes a child; drawn by the scores of all that each has made."""
    if len(arms) == 1:
        return arms[0]
    return arms[_draw_best((scores.by_arm.get(arm, ()) for arm in arms), rng)]
