"""Search settings."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import BaseModel, Field

from agentflow.search.registry import STRATEGIES

INDEPENDENT = "independent"
"""The strategy that refines nothing."""
MAP_ELITES = "map-elites"
"""The strategy that needs pyribs."""


class UcbSettings(BaseModel, frozen=True, extra="forbid"):
    """How MCTS-style search balances exploitation and exploration."""

    c: float = Field(
        math.sqrt(2), ge=0, allow_inf_nan=False, description="exploration constant (published: 2)"
    )
    scale: Literal["minmax", "none"] = Field(
        "minmax",
        description="minmax: scale rewards to [0, 1] over the current tree; none: raw scores",
    )


class SearchSettings(BaseModel, frozen=True, extra="forbid"):
    """Strategy and budget; all strategies share these keys, so sweeps can compare them."""

    strategy: str = Field(
        "halving",
        description=f"how the next machine to refine is selected: {', '.join(STRATEGIES.ours)}",
    )
    rounds: int = Field(5, ge=0, description="expansions per search")
    width: int = Field(
        4, ge=1, description="children per expansion (random search always makes one)"
    )
    request_rounds: int = Field(
        5, ge=1, description="maximum rounds of concurrent requests per expansion"
    )
    ucb: UcbSettings = Field(UcbSettings(), description="selection settings of mcts")
    options: dict[str, Any] = Field(
        {}, description="options of a strategy from another package, which that checks"
    )

    @property
    def children(self) -> int:
        """Children that each expansion makes: the width, or one in random search."""
        return 1 if self.strategy == "random" else self.width
