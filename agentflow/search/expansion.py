"""Owns one expansion: waves of attempts until there are enough children or no waves left.

Which node is expanded is the strategies' choice; evaluating the children is the tree's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from agentflow.errors import BudgetSpentError
from agentflow.search.node import Attempt, C, Expand, Node


@dataclass(frozen=True)
class Expansion(Generic[C]):
    """All attempts of one expansion, and the children (candidate, attempt label) they gave."""

    attempts: tuple[Attempt[C], ...]
    children: tuple[tuple[C, str], ...]
    fallback: bool = False
    """Whether the only child is the parent's own candidate, for want of a valid attempt."""
    stopped: bool = False
    """Whether the budget ran out; children answered for before that are kept."""


async def expand_node(
    node: Node[C], expand: Expand[C], prefix: str, width: int, waves: int
) -> Expansion[C]:
    """Ask for `width` children of a node (spec 5.1).

    The first wave asks for all, each later one for as many as are still missing, and knows what
    became of the earlier attempts. With no valid child after the last wave, the parent's candidate
    becomes the single child.

    Args:
        node: The node to expand.
        expand: Runs one wave.
        prefix: Of the labels, which count on over the waves: "{prefix}/try-1", ...
        width: Children wanted.
        waves: Most waves.
    """
    attempts: list[Attempt[C]] = []
    stopped = False
    for _ in range(waves):
        missing = width - sum(attempt.candidate is not None for attempt in attempts)
        if not missing or stopped:
            break
        first = len(attempts) + 1
        labels = [f"{prefix}/try-{number}" for number in range(first, first + missing)]
        try:
            wave = await expand(node, labels, tuple(attempts))
        except BudgetSpentError:
            wave = ()
        attempts += wave
        stopped = len(wave) < missing
    children = tuple(
        (attempt.candidate, attempt.label) for attempt in attempts if attempt.candidate is not None
    )
    if children or stopped:
        return Expansion(tuple(attempts), children, stopped=stopped)
    return Expansion(tuple(attempts), ((node.candidate, ""),), fallback=True)
