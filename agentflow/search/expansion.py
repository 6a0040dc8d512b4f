"""Expansion: waves of attempts until a node has enough children or no waves are left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from agentflow.errors import BudgetSpentError
from agentflow.search.node import Attempt, C, Expand, Node


@dataclass(frozen=True)
class Expansion(Generic[C]):
    """All attempts of one expansion and the resulting (candidate, attempt label) pairs."""

    attempts: tuple[Attempt[C], ...]
    children: tuple[tuple[C, str], ...]
    fallback: bool = False
    """Whether no attempt was valid, so the only child repeats the parent's candidate."""
    stopped: bool = False
    """Whether the budget ran out; children received before that are kept."""


async def expand_node(
    node: Node[C], expand: Expand[C], prefix: str, width: int, waves: int
) -> Expansion[C]:
    """Make up to `width` children of a node.

    The first wave makes `width` attempts; each later wave makes one per missing child and is given
    the earlier attempts. If no attempt is valid after the last wave, the parent's candidate becomes
    the only child.

    Args:
        node: The node to expand.
        expand: Runs one wave.
        prefix: Prefix of the labels, "{prefix}/try-1", ..., numbered across waves.
        width: Number of children wanted.
        waves: Maximum number of waves.
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
