"""The registry of search strategies. Importing it loads none of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from agentflow.registry import Registry, is_callable

STRATEGIES: Registry[Callable[..., Any]] = Registry(
    "search strategy",
    "agentflow.strategies",
    {
        "halving": "agentflow.search.pooled.halving:Halving",
        "mcts": "agentflow.search.mcts:mcts",
        "best_of_n": "agentflow.search.best_of_n:best_of_n",
        "random": "agentflow.search.random:random",
        "ab-mcts": "agentflow.search.pooled.ab_mcts:AdaptiveBranching",
        "half-and-half": "agentflow.search.pooled.halving:HalfAndHalf",
        "independent": "agentflow.search.pooled.independent:Independent",
        "map-elites": "agentflow.search.elites.map_elites:map_elites",
    },
    is_callable,
)
"""A strategy is a coroutine function with the arguments of `mcts`, which searches from one
candidate, or a class derived from `PooledStrategy`, which deals the budget of a whole run.

A function that also has a parameter `rng` gets its own `random.Random`. A function or a class that
has a parameter `options`, annotated with a pydantic model, gets `search.options` as that model.
"""
