"""The registry of search strategies."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import TYPE_CHECKING, Protocol

from agentflow.registry import Registry

if TYPE_CHECKING:
    from agentflow.search.events import Observer
    from agentflow.search.node import C, Evaluate, Evaluation, Expand, SearchResult
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
        observe: Observer = ...,
    ) -> Awaitable[SearchResult[C]]:
        """Run the search."""


STRATEGIES: Registry[Strategy] = Registry(
    "search strategy",
    "agentflow.strategies",
    {
        "mcts": "agentflow.search.mcts:mcts",
        "best_of_n": "agentflow.search.best_of_n:best_of_n",
        "random": "agentflow.search.random:random",
    },
    lambda _, thing: "" if callable(thing) else "is not a function",
)
