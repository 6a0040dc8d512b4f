"""Registry of search strategies."""

from __future__ import annotations

from collections.abc import Awaitable, Mapping
from types import MappingProxyType
from typing import Protocol

from agentflow.errors import UnknownNameError
from agentflow.search.best_of_n import best_of_n
from agentflow.search.events import Observer, ignore
from agentflow.search.mcts import mcts
from agentflow.search.node import C, Evaluate, Evaluation, Expand, SearchResult
from agentflow.search.random import random
from agentflow.search.settings import SearchSettings


class Strategy(Protocol):
    """A search strategy; see `mcts` for the arguments."""

    def __call__(
        self,
        root: C,
        evaluation: Evaluation,
        expand: Expand[C],
        evaluate: Evaluate[C],
        settings: SearchSettings,
        observe: Observer = ignore,
    ) -> Awaitable[SearchResult[C]]:
        """Run the search."""


STRATEGIES: Mapping[str, Strategy] = MappingProxyType(
    {"mcts": mcts, "best_of_n": best_of_n, "random": random}
)


def strategy(name: str) -> Strategy:
    """The strategy with this name.

    Raises:
        UnknownNameError: No strategy has this name.
    """
    if name not in STRATEGIES:
        raise UnknownNameError("search strategy", name, STRATEGIES)
    return STRATEGIES[name]
