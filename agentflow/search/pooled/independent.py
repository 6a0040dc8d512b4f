"""Independent sampling: only first candidates, the baseline that any search must beat."""

from __future__ import annotations

from random import Random
from typing import Any

from agentflow.search.pooled.pool import Choice, Pool, PooledStrategy


class Independent(PooledStrategy):
    """Always a new first candidate; nothing is refined."""

    learns = False

    def choose(self, pool: Pool[Any], rng: Random) -> Choice | None:
        """A new branch; several openers are equally likely."""
        return None if pool.is_full else Choice(rng.choice(pool.openers))
