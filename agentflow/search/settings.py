"""Owns the numbers of a search. Who uses which number, the strategies say."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class UcbSettings(BaseModel):
    """How MCTS-style search weighs what is good against what is little tried."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    c: float = Field(
        math.sqrt(2), ge=0, allow_inf_nan=False, description="weight of exploration (published: 2)"
    )
    scale: Literal["minmax", "none"] = Field(
        "minmax",
        description="minmax: rewards scaled into [0, 1] by the tree so far; none: raw scores",
    )


class SearchSettings(BaseModel):
    """Strategy and budget; the same keys for all strategies, so that a sweep can compare them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    strategy: Literal["mcts", "best_of_n", "random"] = Field(
        "mcts", description="how the next machine to refine is chosen"
    )
    rounds: int = Field(5, ge=0, description="expansions per search")
    width: int = Field(
        4, ge=1, description="children per expansion (random search always makes one)"
    )
    waves: int = Field(5, ge=1, description="waves of attempts per expansion")
    ucb: UcbSettings = Field(UcbSettings(), description="selection of mcts")
