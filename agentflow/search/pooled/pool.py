"""One budget for many first candidates and all that is made from them, dealt by a strategy.

A *branch* is a first candidate and everything refined from it. A strategy chooses, again and again,
between a new branch and a child of some node; nothing is divided in advance. Several choices are
carried out at the same time, a round. Branches and nodes are numbered by choice, not by arrival, so
that the result does not depend on concurrency.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Collection, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, Generic

from agentflow.search.concurrency import run_concurrently
from agentflow.search.node import Attempt, C, Node
from agentflow.search.tree import Growth, SearchTree

PATIENCE = 10
"""Rounds in a row that evaluate nothing new, after which a search ends."""
FEW = 8
"""So few evaluations are too few to compare branches, or who makes children."""
ROUNDS = 8
"""Fewest rounds of a search, unless each makes only one choice: what a round shows guides the
next."""


@dataclass(frozen=True)
class Choice:
    """What to make next."""

    arm: str
    branch: int = 0
    """Number of the branch to continue; 0 begins a new one."""
    node: int = 0
    """Id of the node to make a child of."""


@dataclass
class Branch(Generic[C]):
    """A first candidate and what was made from it."""

    number: int
    arm: str
    tree: SearchTree[C] | None = None
    """None if no valid first candidate was made."""
    arms: dict[int, str] = field(default_factory=dict)
    """Id of a node -> who made it; the first candidate is 0."""


class PooledStrategy(ABC):
    """Decides what is made next."""

    learns = True
    """Whether its choices depend on what was made before."""

    @abstractmethod
    def choose(self, pool: Pool[Any], rng: Random) -> Choice | None:
        """The next thing to make; None ends the search.

        It is asked several times before the first of these is made; only `rng` differs.
        """


class Pool(Generic[C]):
    """All branches of one search."""

    def __init__(
        self,
        openers: Sequence[str],
        arms: Sequence[str],
        most_branches: int | None = None,
        besides: str = "besides",
        free: Collection[str] = (),
    ) -> None:
        """Begin empty.

        Args:
            openers: Who can make first candidates.
            arms: Who can make children; none if nothing is refined.
            most_branches: Most branches; None for no limit.
            besides: Who made a child that no arm was asked for.
            free: Those of the arms that ask no question; openers do.
        """
        self.openers, self.most_branches = tuple(openers), most_branches
        self.besides = besides
        self._every, self.free = tuple(arms), tuple(arm for arm in arms if arm in free)
        self.branches: list[Branch[C]] = []
        self.used = 0.0
        """Share of the budget that was used before this round, from 0 to 1: that of evaluations or
        of questions, whichever is greater; of evaluations once no question is left."""
        self.total: float = math.inf
        """Evaluations or questions at the start, whichever were fewer."""
        self.evaluations: float = math.inf
        """How many are left."""
        self.questions: float = math.inf
        """How many are left; without a limit, infinitely many."""

    @property
    def arms(self) -> tuple[str, ...]:
        """Who can make children now: without questions, who asks none; only who asks, if questions
        would be left over otherwise, or if there are few evaluations."""
        if self.questions < 1:
            return self.free
        spare = math.isfinite(self.questions) and self.questions >= self.evaluations
        if spare or self.is_small:
            return tuple(arm for arm in self._every if arm not in self.free) or self._every
        return self._every

    @property
    def is_small(self) -> bool:
        """Whether all evaluations are few."""
        return self.total <= FEW

    @property
    def nodes(self) -> list[tuple[Branch[C], Node[C]]]:
        """All nodes with their branches, by branch and id."""
        trees = ((branch, branch.tree) for branch in self.branches)
        return [(branch, node) for branch, tree in trees if tree for node in tree.nodes]

    def gains(self) -> dict[str, list[float]]:
        """Who made children -> by how much each is better than its parent; 0 if it is not."""
        gains: dict[str, list[float]] = {}
        for branch, node in self.nodes:
            if node.parent is not None and branch.tree is not None:
                gain = worth(node) - worth(branch.tree.nodes[node.parent])
                gains.setdefault(branch.arms[node.id], []).append(max(0.0, gain))
        return gains

    def records(self) -> dict[str, list[float]]:
        """Who made first candidates -> by how much each is better than all earlier ones; 0 if it is
        not, or is the very first."""
        gains: dict[str, list[float]] = {}
        best: float | None = None
        for branch in self.branches:
            if branch.tree is not None:
                reward = worth(branch.tree.nodes[0])
                best = reward if best is None else best
                gains.setdefault(branch.arm, []).append(max(0.0, reward - best))
                best = max(reward, best)
        return gains

    @property
    def is_full(self) -> bool:
        """Whether no new branch may begin. Without questions, the first still may, so that the
        result has a reason."""
        full = self.most_branches is not None and len(self.branches) >= self.most_branches
        return full or (self.questions < 1 and bool(self.branches))

    @property
    def is_over(self) -> bool:
        """Whether no candidate can do better than the best."""
        trees = [branch.tree for branch in self.branches if branch.tree]
        return any(tree.best().evaluation.perfect for tree in trees)


def worth(node: Node[Any]) -> float:
    """The reward of a node; 0 without one."""
    return node.evaluation.reward or 0.0


Open = Callable[[Branch[C]], Awaitable[SearchTree[C] | None]]
"""Makes and evaluates the first candidate of a branch; None if it is not valid."""
ExpandWith = Callable[
    [Branch[C], Node[C], Sequence[tuple[str, str]], Sequence[Attempt[C]]],
    Awaitable[Sequence[Attempt[C]]],
]
"""As `Expand`, with the branch, and with who makes it for each label."""


async def search_pool(
    pool: Pool[C],
    strategy: PooledStrategy,
    open_branch: Open[C],
    expand: ExpandWith[C],
    left: Callable[[], int],
    width: int,
    rng: Random,
    *,
    opening_cost: int = 1,
    preparing: Callable[[Choice, int], int] = lambda _choice, _left: 0,
    questions: Callable[[], float] = lambda: math.inf,
) -> None:
    """Carry out the choices of a strategy until nothing is left of the budget.

    Args:
        pool: Filled by the search.
        strategy: Chooses.
        open_branch: Makes a first candidate.
        expand: Makes children.
        left: How many more candidates may be evaluated.
        width: Most choices per round.
        rng: What the strategy draws from.
        opening_cost: Most evaluations that a first candidate takes.
        preparing: Given a choice of a child and what is left besides it, how many more evaluations
            are made before it.
        questions: How many more questions may be asked, if there is a limit.
    """
    round_ = idle = 0
    total, most = left(), questions()
    pool.total = min(total, most)
    if strategy.learns:
        width = max(1, min(width, int(pool.total) // ROUNDS))
    while (before := left()) > 0 and idle < PATIENCE and not pool.is_over:
        rest = before
        pool.questions = questions()
        asked = 1 - pool.questions / most if 1 <= pool.questions < math.inf else 0.0
        pool.used = max(1 - before / total, asked)
        round_ += 1
        begun: list[Branch[C]] = []
        groups: dict[tuple[int, int], list[str]] = {}
        for _ in range(width):
            pool.evaluations = rest
            choice = strategy.choose(pool, rng)
            if choice is None:
                break
            pool.questions -= choice.arm not in pool.free
            if choice.branch and rest >= 1:
                groups.setdefault((choice.branch, choice.node), []).append(choice.arm)
                rest -= 1
                rest -= preparing(choice, rest)
            number = len(pool.branches) + len(begun) + 1
            open_ = pool.most_branches is None or number <= pool.most_branches
            if not choice.branch and open_ and rest >= opening_cost:
                begun.append(Branch(number, choice.arm))
                rest -= opening_cost
        if not begun and not groups:
            break
        opening = run_concurrently(_open(branch, open_branch) for branch in begun)
        growing = _grow(pool, round_, groups, expand)
        await run_concurrently((opening, growing))
        pool.branches += begun
        idle = 0 if left() < before else idle + 1


async def _open(branch: Branch[C], open_branch: Open[C]) -> None:
    branch.tree = await open_branch(branch)
    branch.arms[0] = branch.arm


async def _grow(
    pool: Pool[C],
    round_: int,
    groups: dict[tuple[int, int], list[str]],
    expand: ExpandWith[C],
) -> None:
    """Make children of several nodes; all are requested first, then all are evaluated."""
    grown: list[tuple[Branch[C], SearchTree[C], Node[C], list[str]]] = []
    for (number, node), arms in groups.items():
        branch = pool.branches[number - 1]
        assert branch.tree is not None
        grown.append((branch, branch.tree, branch.tree.nodes[node], arms))
    askers = [_Asker(branch, arms, expand) for branch, _, _, arms in grown]
    requested = await run_concurrently(
        tree.request(parent, round_, len(arms), asker)
        for (_, tree, parent, arms), asker in zip(grown, askers, strict=True)
    )
    growths: list[Growth[C]] = []
    for (branch, tree, parent, _), asker, attempts in zip(grown, askers, requested, strict=True):
        growth = tree.number(parent, round_, attempts, fallback=False)
        growths.append(growth)
        for id_, (_, label) in zip(growth.ids, growth.new, strict=True):
            branch.arms[id_] = asker.arms.get(label, pool.besides)
    trees = [tree for _, tree, _, _ in grown]
    evaluated = await run_concurrently(
        run_concurrently(tree.evaluations(growth))
        for tree, growth in zip(trees, growths, strict=True)
    )
    for tree, growth, evaluations in zip(trees, growths, evaluated, strict=True):
        tree.join(growth, evaluations)


class _Asker(Generic[C]):
    """The `expand` of one node: who failed is asked again."""

    def __init__(self, branch: Branch[C], arms: Sequence[str], expand: ExpandWith[C]) -> None:
        self.arms: dict[str, str] = {}
        """Label -> who makes it."""
        self._branch, self._waiting, self._expand = branch, list(arms), expand

    async def __call__(
        self, node: Node[C], labels: Sequence[str], earlier: Sequence[Attempt[C]]
    ) -> Sequence[Attempt[C]]:
        # A child that nobody was asked for takes the place of an attempt that failed.
        asked = list(zip(labels, self._waiting, strict=False))
        self.arms |= dict(asked)
        made = await self._expand(self._branch, node, asked, earlier)
        self._waiting = [self.arms[item.label] for item in made if item.candidate is None]
        return made
