"""Successive halving: many first candidates, of which ever fewer are improved.

First, branches begin. Then children are made of the best node of one of the eight best branches,
later of the four best, of the two best, and at last of the best one, for equal parts of what is
left of the budget (after Karnin et al. 2013 and Jamieson and Talwalkar 2016, who choose one out of
many like this). Who makes each child is drawn by what it may gain; a new first candidate competes
with children, so that a search that improves nothing goes back to making them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random
from typing import Any

from agentflow.search.node import Node
from agentflow.search.pooled.ab_mcts import Scores, draw_arm
from agentflow.search.pooled.pool import Branch, Choice, Pool, PooledStrategy, worth

BEGINNING = 0.5
"""Largest share of the budget that makes first candidates before children are made."""
BEGUN = 40
"""Most first candidates before that: after so many, the next one is rarely the best."""
SPARE = 4
"""First candidates that may fail or repeat others, besides as many as do not."""
KEPT = (8, 4, 2, 1)
"""How many branches go on, in each equal part of the rest."""
FAILURES = 3
"""Children that did not improve anything, as the prior of who makes them assumes; one did."""
GAIN = 0.2
"""Gain of that one, in gains of a first candidate that is the best of all."""
SHARPNESS = 4
"""How many times each child and each branch counts in what is drawn from. Draws are then nearer to
the mean, and less of the budget goes to what has gained less."""


class Halving(PooledStrategy):
    """First candidates for up to half of the budget, then ever fewer branches that climb."""

    kept: Sequence[int] = KEPT
    most_begun: float = BEGUN

    def __init__(self) -> None:
        self._beginning: float | None = None
        """Share of the budget that was used when the first children were made."""

    def choose(self, pool: Pool[Any], rng: Random) -> Choice | None:
        """A new branch, or a child of the best node of a branch that goes on."""
        opening = None if pool.is_full else Choice(_opener(pool, rng))
        lines = sorted((line for line in pool.branches if line.tree), key=_reward, reverse=True)
        if not lines or not pool.arms or (opening and self._begins(pool, lines)):
            return opening
        if self._beginning is None:
            self._beginning = pool.used
        climbed = (pool.used - self._beginning) / (1 - self._beginning)
        line = rng.choice(lines[: self.kept[int(climbed * len(self.kept))]])
        arm = self._arm(pool, lines, rng)
        return opening if arm is None else Choice(arm, line.number, _best(line).id)

    def _begins(self, pool: Pool[Any], lines: Sequence[Branch[Any]]) -> bool:
        """Whether all choices are new branches: no children have been made yet, and not too many
        first candidates; fewer if most of them fail or repeat others."""
        begun, different = len(pool.branches), len({_root(line).candidate for line in lines})
        most = min(self.most_begun, 2 * different + SPARE)
        return self._beginning is None and pool.used < BEGINNING and begun < most

    def _arm(self, pool: Pool[Any], lines: Sequence[Branch[Any]], rng: Random) -> str | None:
        """Who makes the next child; None for a new branch.

        Each is worth its chance of an improvement times how large one is. How likely children
        improve their parents is drawn from a posterior; a new branch is the best of all so many
        with a chance of one in so many.
        """
        gains, record = pool.gains(), tail(pool)
        drawn: list[tuple[float, float, str | None]] = []
        if not pool.is_full:
            firsts = [worth(_root(line)) for line in lines]
            behind = max(0.0, _reward(lines[0]) - max(firsts))  # a failed simulation counts as 0
            size = record * math.exp(-behind / record) if record else 0.0
            drawn.append((_draw(rng, 1, len(pool.branches)) * size, rng.random(), None))
        every = [gain for made in gains.values() for gain in made if gain > 0]
        usual = (sum(every) + GAIN * record) / (len(every) + 1)
        for arm in pool.arms:
            made = gains.get(arm, [])
            better = [gain for gain in made if gain > 0]
            chance = _draw(rng, 1 + len(better), FAILURES + len(made) - len(better))
            size = (sum(better) + usual) / (len(better) + 1)
            drawn.append((chance * size, rng.random(), arm))
        return max(drawn, key=lambda item: item[:2])[2]


class HalfAndHalf(Halving):
    """Half of the budget makes first candidates, or less if most of them fail or repeat others; the
    arms, equally likely, improve the best."""

    kept = (1,)
    most_begun = math.inf

    def _arm(self, pool: Pool[Any], lines: Sequence[Branch[Any]], rng: Random) -> str | None:  # noqa: ARG002
        return rng.choice(pool.arms)


def tail(pool: Pool[Any]) -> float:
    """How much better than the others the best first candidates are.

    As many of them as the square root of their number, on average, compared with the next one: that
    is about how much a new best one is better. Equal ones count once.
    """
    roots = (_root(line) for line in pool.branches if line.tree)
    firsts = sorted({root.candidate: worth(root) for root in roots}.values(), reverse=True)
    many = math.isqrt(len(firsts))
    # Rounding can put the mean of equal ones below them.
    return max(0.0, sum(firsts[:many]) / many - firsts[min(many, len(firsts) - 1)])


def _opener(pool: Pool[Any], rng: Random) -> str:
    """Who makes a first candidate, by the scores of all that each has made."""
    only = rng.choice(pool.openers)  # drawn in any case: later draws are then those of one opener
    return only if len(pool.openers) == 1 else draw_arm(Scores(pool), pool.openers, rng)


def _draw(rng: Random, successes: int, failures: int) -> float:
    """A chance of success."""
    return rng.betavariate(SHARPNESS * successes, SHARPNESS * failures)


def _root(branch: Branch[Any]) -> Node[Any]:
    assert branch.tree is not None
    return branch.tree.nodes[0]


def _best(branch: Branch[Any]) -> Node[Any]:
    assert branch.tree is not None
    return branch.tree.best()


def _reward(branch: Branch[Any]) -> float:
    return worth(_best(branch))
