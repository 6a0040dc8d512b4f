"""Successive halving: many first candidates, of which ever fewer are improved.

First, branches begin. Then children are made of the best node of one of the eight best branches,
later of the four best, of the two best, and at last of the best one, for equal parts of what is
left of the budget (after Karnin et al. 2013 and Jamieson and Talwalkar 2016, who choose one out of
many like this). Half of the time, which of them gets a child, and who makes it, is drawn by what
that may gain over the best of all; otherwise each of them is as likely, as what lies behind may
still make a leap that no child has made yet. A new first candidate competes with children: a search
that improves nothing goes back to making them.
"""

from __future__ import annotations

import math
import operator
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
EVENLY = 0.5
"""Share of the choices that are the same for every branch that goes on."""
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
        if lines and pool.arms and pool.is_small:
            opening = None  # one branch is improved
        if not lines or not pool.arms or (opening and self._begins(pool, lines)):
            return opening
        if self._beginning is None:
            self._beginning = pool.used
        climbed = max(0.0, pool.used - self._beginning) / (1 - self._beginning)
        going_on = lines[: self.kept[int(climbed * len(self.kept))]]
        return self._next(pool, going_on, opening, rng)

    def _begins(self, pool: Pool[Any], lines: Sequence[Branch[Any]]) -> bool:
        """Whether all choices are new branches: no children have been made yet, and not too many
        first candidates; fewer if most of them fail or repeat others."""
        begun, different = len(pool.branches), len({_root(line).candidate for line in lines})
        most = min(self.most_begun, 2 * different + SPARE)
        return self._beginning is None and pool.used < BEGINNING and begun < most

    def _next(
        self,
        pool: Pool[Any],
        going_on: Sequence[Branch[Any]],
        opening: Choice | None,
        rng: Random,
    ) -> Choice:
        """The next child, or the opening of a new branch, unless that is None.

        Each is worth its chance of an improvement times what this gains over the best of all, or
        over its parent, if that is drawn evenly. How likely children improve their parents is drawn
        from a posterior; a new branch is the best of all so many with a chance of one in so many.
        """
        evenly = rng.random() < EVENLY
        considered = [rng.choice(going_on)] if evenly else going_on
        gains, record, best = pool.gains(), tail(pool), _reward(going_on[0])
        drawn: list[tuple[float, float, float, Choice]] = []
        if opening:
            first = max(worth(_root(line)) for line in pool.branches if line.tree)
            value = _draw(rng, 1, len(pool.branches)) * _beyond(record, best - first)
            drawn.append((value, rng.random(), 0.0, opening))
        every = [gain for made in gains.values() for gain in made if gain > 0]
        usual = (sum(every) + GAIN * record) / (len(every) + 1)
        for arm in pool.arms:
            made, tied = gains.get(arm, []), rng.random()
            better = [gain for gain in made if gain > 0]
            size = (sum(better) + usual) / (len(better) + 1)
            for line in considered:
                chance = _draw(rng, 1 + len(better), FAILURES + len(made) - len(better))
                behind = 0.0 if evenly else best - _reward(line)
                value = chance * _beyond(size, behind)
                child = Choice(arm, line.number, _best(line).id)
                drawn.append((value, tied, rng.random(), child))
        return max(drawn, key=lambda item: item[:3])[3]


class HalfAndHalf(Halving):
    """Half of the budget makes first candidates, or less if most of them fail or repeat others; the
    arms, equally likely, improve the best."""

    kept = (1,)
    most_begun = math.inf

    def _next(
        self,
        pool: Pool[Any],
        going_on: Sequence[Branch[Any]],
        opening: Choice | None,  # noqa: ARG002
        rng: Random,
    ) -> Choice:
        return Choice(rng.choice(pool.arms), going_on[0].number, _best(going_on[0]).id)


def tail(pool: Pool[Any]) -> float:
    """By how much a first candidate that is better than all others exceeds the best of them.

    The best ones, as many as the square root of their number, are taken to exceed the next one by a
    generalized Pareto distribution, fitted by probability-weighted moments (Hosking and Wallis
    1987): little is left to gain where they come near a limit. Its tail is at most exponential.
    Equal ones count once.
    """
    roots = (_root(line) for line in pool.branches if line.tree)
    firsts = sorted({root.candidate: worth(root) for root in roots}.values())
    many = min(math.isqrt(len(firsts)), len(firsts) - 1)
    over = [first - firsts[-many - 1] for first in firsts[len(firsts) - many :]]
    mean = sum(over) / max(1, many)
    weights = (1 - (rank + 0.65) / many for rank in range(many))
    spread = mean - 2 * sum(map(operator.mul, weights, over)) / max(1, many)
    shape = min(0.0, 2 - mean / spread) if spread > 0 else 0.0
    return max(0.0, mean + shape / (1 - shape) * max(over, default=0.0))


def _beyond(size: float, behind: float) -> float:
    """What gains of this mean size, falling off exponentially, leave beyond the best of all, from
    so far behind it; a failed simulation counts as 0 and may be ahead of it."""
    return size * math.exp(-max(0.0, behind) / size) if size > 0 else 0.0


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
