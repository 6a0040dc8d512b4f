"""Search types: evaluations, attempts, nodes, results, and the `expand` and `evaluate` signatures.

A candidate is any hashable value; search never looks inside it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from agentflow.search.elites.axes import Measurement
from agentflow.search.pareto import Point

C = TypeVar("C")
"""A candidate."""


@dataclass(frozen=True)
class Evaluation:
    """The result of evaluating a candidate.

    `score` is None if the infrastructure failed (timeout, crash) rather than the candidate. Such a
    result does not count as 0, and means exclude it.
    """

    valid: bool
    score: float | None
    details: Any = None
    """Data of the domain, passed through unchanged."""
    perfect: bool = False
    """Whether no candidate can do better, so that a search ends."""
    value: float | None = None
    """What searches compare, if not the score."""
    missed: float | None = None
    """Below 0, what they compare in place of both, of a candidate that misses what is required."""
    measurements: tuple[Measurement, ...] = ()
    """What kind of candidate it is, for searches that keep different kinds: one per axis, and the
    same axes for every candidate of a search."""
    objectives: Point | None = None
    """What searches for a Pareto front compare besides; None in other searches."""

    @property
    def reward(self) -> float | None:
        """What searches compare: the value, or else the score; of a candidate that misses what is
        required, how much it misses."""
        known = (self.missed, self.value, self.score)
        return next((one for one in known if one is not None), None)


@dataclass(frozen=True)
class Attempt(Generic[C]):
    """One attempt at a child: a candidate, or None and the reason."""

    label: str
    candidate: C | None
    note: str
    """Shown to later attempts of the same expansion."""


@dataclass
class Node(Generic[C]):
    """A candidate in a tree. Ids number the nodes in order of creation; the root is 0."""

    id: int
    candidate: C
    parent: int | None
    evaluation: Evaluation
    label: str = ""
    """Label of the attempt that made it; empty for the root and for a fallback child."""
    reward: float | None = None
    """What it was worth among the nodes of the tree when it joined them; None without a score."""
    children: list[int] = field(default_factory=list)
    visits: int = 0
    total: float = 0.0
    """Sum of the rewards backed up through this node."""


Expand = Callable[[Node[C], Sequence[str], Sequence[Attempt[C]]], Awaitable[Sequence[Attempt[C]]]]
"""expand(node, labels, earlier) -> one attempt per label, in label order.

Runs one round of concurrent attempts. Further valid attempts may come with them, under labels of
their own, which have cost nothing. `earlier` holds the attempts of earlier rounds of this
expansion. Labels such as "round-2/node-3/try-5" are unique within the search. If the budget runs
out during a round, only the completed attempts are returned, or BudgetSpentError is raised if there
are none. Either ends the search.
"""

Evaluate = Callable[[C, str], Awaitable[Evaluation]]
"""evaluate(candidate, label) -> evaluation; the label names the node ("round-2/node-3")."""


@dataclass
class SearchCost:
    """What a search cost, counted the same way for all strategies."""

    expansions: int = 0
    attempts: int = 0
    valid: int = 0
    """Attempts that produced a child."""
    rollouts: int = 0
    """Distinct candidates evaluated, not counting the root."""
    seconds: float = field(default=0.0, compare=False)
    """Wall time; ignored by comparison."""


@dataclass(frozen=True)
class SearchResult(Generic[C]):
    """The outcome of a search."""

    nodes: tuple[Node[C], ...]
    result: int
    """Id of the node that the strategy returns."""
    best: int
    """Id of the best node of the whole tree; the lowest id among equals."""
    cost: SearchCost
    stopped: bool = False
    """Whether the budget ran out before the last round."""

    @property
    def perfect(self) -> bool:
        """Whether no candidate can score higher than the best."""
        return self.nodes[self.best].evaluation.perfect
