"""When the score of a machine holds, and which machines are fragile.

The rule is here, as both physics and the records of runs ask it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

LEAST = 0.5
"""Share of the verified score that must be left; chosen, as for neighbours of a robust machine."""


@dataclass(frozen=True)
class Holding:
    """In which simulations of a verification the score of a machine holds.

    It holds where it is above 0 and at least half of the verified score. What a family punishes,
    such as a break or an obstacle that was not passed, counts by what it costs.
    """

    of: int
    """Number of simulations."""
    fails: tuple[str, ...]
    """Variations under which it does not hold."""

    @classmethod
    def of_verified(cls, verified: Mapping[str, Any]) -> Holding | None:
        """By the data of a verification: `score` and, of each simulation, `variation` and `score`.

        None if it is incomplete.
        """
        middle, scores = verified["score"], [item["score"] for item in verified["scores"]]
        if middle is None or None in scores:
            return None
        fails = (
            item["variation"]
            for item in verified["scores"]
            if not (item["score"] > 0 and item["score"] >= LEAST * middle)
        )
        return cls(len(scores), tuple(fails))

    @property
    def holds(self) -> int:
        """Number of simulations in which it holds."""
        return self.of - len(self.fails)

    @property
    def fragile(self) -> bool:
        """Whether it holds in some but not in all; a machine that never scores has nothing to
        lose."""
        return 0 < self.holds < self.of

    def __str__(self) -> str:
        return f"holds in {self.holds} of {self.of}{', fragile' * self.fragile}"


def with_holding(verified: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """The data of a verification, for readers: with `holds` (in how many simulations), `fails` (the
    variations under which it does not) and `fragile`; None for each if it is incomplete."""
    if verified is None:
        return None
    found = Holding.of_verified(verified)
    told = (None, None, None) if found is None else (found.holds, list(found.fails), found.fragile)
    return {**verified, **dict(zip(("holds", "fails", "fragile"), told, strict=True))}
