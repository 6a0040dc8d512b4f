"""Owns the vocabulary of search: evaluations, attempts, nodes, and the two functions it is given.

A candidate is anything hashable; search never looks into it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

C = TypeVar("C")


@dataclass(frozen=True)
class Evaluation:
    """What trying a candidate gave.

    `score` is None when the computer, not the candidate, failed (timeout, crash): such a result
    counts neither as zero nor in means.
    """

    valid: bool
    score: float | None
    details: Any = None
    """Whatever the domain wants to hand on; search does not look at it."""


@dataclass(frozen=True)
class Attempt(Generic[C]):
    """One reply to an expansion: a child, or the reason why there is none."""

    label: str
    candidate: C | None
    note: str
    """Told to the later attempts of the same expansion."""


@dataclass
class Node(Generic[C]):
    """A candidate in a tree. Ids count from 0 (the root) in order of creation."""

    id: int
    candidate: C
    parent: int | None
    evaluation: Evaluation
    label: str = ""
    """Of the attempt that made it; empty for the root and for a parent fallen back to."""
    children: list[int] = field(default_factory=list)
    visits: int = 0
    total: float = 0.0
    """Sum of the rewards backed up through this node."""


Expand = Callable[[Node[C], Sequence[str], Sequence[Attempt[C]]], Awaitable[Sequence[Attempt[C]]]]
"""expand(node, labels, earlier) -> one attempt per label, in label order.

One wave: the calls run at once. `earlier` are the attempts of the earlier waves of this expansion;
the labels are "round-2/node-3/try-5" and unique within the search. When the budget runs out within
a wave, the attempts that were answered come back, fewer than labels; when none was answered,
BudgetSpentError is raised. Either ends the search.
"""

Evaluate = Callable[[C, str], Awaitable[Evaluation]]
"""evaluate(candidate, label) -> evaluation; the label names the node ("round-2/node-3")."""


@dataclass
class SearchCost:
    """What a search cost; the same for all strategies, so that equal budgets can be compared."""

    expansions: int = 0
    attempts: int = 0
    valid: int = 0
    """Attempts that gave a child."""
    rollouts: int = 0
    """Distinct candidates evaluated, the root not counted."""
    seconds: float = field(default=0.0, compare=False)
    """Wall time; no part of what makes two searches equal."""


@dataclass(frozen=True)
class SearchResult(Generic[C]):
    """The outcome of a search."""

    nodes: tuple[Node[C], ...]
    result: int
    """Node id of the strategy's answer."""
    best: int
    """Node id of the best candidate met anywhere; the lower id among equals."""
    cost: SearchCost
    stopped: bool = False
    """Whether the budget ended it before its last round; everything above is what it had."""
