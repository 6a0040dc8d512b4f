"""Best-of-N, but any child is better than the root."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from agentflow.search.best_of_n import best_of_n


async def eager(root: Any, evaluation: Any, expand: Any, evaluate: Any, *rest: Any) -> Any:
    """Take every child for an improvement."""
    return await best_of_n(root, replace(evaluation, score=0.0), expand, evaluate, *rest)
