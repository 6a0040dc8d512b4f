"""Owns what an observer of a search is told: one event per thing done, in a fixed order.

What becomes of the events (a record, a live view) is the observer's business.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from agentflow.search.node import Attempt, Node


@dataclass(frozen=True)
class Selected:
    """A node was chosen for expansion; `path` are the node ids from the root to it."""

    round: int
    path: tuple[int, ...]


@dataclass(frozen=True)
class Expanded:
    """An expansion ended."""

    round: int
    node: int
    attempts: tuple[Attempt[Any], ...]
    """In label order, all waves."""
    children: tuple[int, ...]
    """Ids of the nodes that come of it; empty only when the budget ran out first."""
    fallback: bool
    """Whether no attempt was valid and the only child is the parent's candidate again."""


@dataclass(frozen=True)
class Simulated:
    """A child was evaluated; told in order of node ids, whichever came back first."""

    round: int
    node: Node[Any]


@dataclass(frozen=True)
class BackedUp:
    """A reward was added to every node of `path`, the root first."""

    round: int
    path: tuple[int, ...]
    reward: float


SearchEvent = Selected | Expanded | Simulated | BackedUp
Observer = Callable[[SearchEvent], None]


def ignore(_event: SearchEvent) -> None:
    """The observer that does nothing."""
