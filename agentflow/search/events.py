"""Events that a search reports to its observer, in a reproducible order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from agentflow.search.elites.archive import Filing
from agentflow.search.elites.axes import Axis
from agentflow.search.node import Attempt, Node


@dataclass(frozen=True)
class Selected:
    """A node was selected for expansion; `path` lists the node ids from the root to it."""

    round: int
    path: tuple[int, ...]


@dataclass(frozen=True)
class Expanded:
    """An expansion has finished."""

    round: int
    node: int
    attempts: tuple[Attempt[Any], ...]
    """Attempts of all request rounds, in label order."""
    children: tuple[int, ...]
    """Ids of the new nodes; empty only if the budget ran out first."""
    fallback: bool
    """Whether no attempt was valid, so the only child repeats the parent's candidate."""


@dataclass(frozen=True)
class Simulated:
    """A child was evaluated; reported in order of node ids, not of completion."""

    round: int
    node: Node[Any]


@dataclass(frozen=True)
class BackedUp:
    """A reward was backed up along `path`, given from the root."""

    round: int
    path: tuple[int, ...]
    reward: float


@dataclass(frozen=True)
class ArchiveOpened:
    """An archive of elites was started; `round` is 0."""

    round: int
    axes: tuple[Axis, ...]


@dataclass(frozen=True)
class Filed:
    """A node was offered to the archive; in round 0, the root."""

    round: int
    node: Node[Any]
    filing: Filing


SearchEvent = Selected | Expanded | Simulated | BackedUp | ArchiveOpened | Filed
Observer = Callable[[SearchEvent], None]
"""Receives every event of a search."""


def ignore(_event: SearchEvent) -> None:
    """Do nothing with the event."""
