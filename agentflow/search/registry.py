"""The registry of search strategies. Importing it loads none of them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

from agentflow.registry import Registry, is_callable

if TYPE_CHECKING:
    from agentflow.search.node import SearchResult

STRATEGIES: Registry[Callable[..., Awaitable[SearchResult[Any]]]] = Registry(
    "search strategy",
    "agentflow.strategies",
    {
        "mcts": "agentflow.search.mcts:mcts",
        "best_of_n": "agentflow.search.best_of_n:best_of_n",
        "random": "agentflow.search.random:random",
        "map-elites": "agentflow.search.elites.map_elites:map_elites",
    },
    is_callable,
)
"""All take the arguments of `mcts`."""
