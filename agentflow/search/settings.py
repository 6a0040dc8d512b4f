"""Search settings."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import BaseModel, Field

INDEPENDENT = "independent"
"""The strategy that refines nothing."""
MAP_ELITES = "map-elites"
"""The strategy that needs pyribs."""


class UcbSettings(BaseModel, frozen=True, extra="forbid"):
    """How MCTS-style search balances exploitation and exploration.

    Attributes:
        c: Exploration constant (published: 2).
        scale: minmax: scale rewards to [0, 1] over the current tree; none: raw scores.
    """

    c: float = Field(math.sqrt(2), ge=0, allow_inf_nan=False)
    scale: Literal["minmax", "none"] = "minmax"


class SearchSettings(BaseModel, frozen=True, extra="forbid"):
    """Strategy and budget; all strategies share these keys, so sweeps can compare them.

    Attributes:
        strategy: How the next machine to refine is selected: halving, mcts, best_of_n, random,
            ab-mcts, half-and-half, independent, map-elites.
        rounds: Expansions per search.
        width: Children per expansion (random search always makes one).
        request_rounds: Maximum rounds of concurrent requests per expansion.
        ucb: Selection settings of mcts.
        options: Options of a strategy from another package, which that checks.
    """

    strategy: str = "halving"
    rounds: int = Field(5, ge=0)
    width: int = Field(4, ge=1)
    request_rounds: int = Field(5, ge=1)
    ucb: UcbSettings = UcbSettings()
    options: dict[str, Any] = {}

    @property
    def children(self) -> int:
        """Children that each expansion makes: the width, or one in random search."""
        return 1 if self.strategy == "random" else self.width
