"""Published results of other models, for comparison.

They were measured in the game, not in this simulator, so they are always labelled and never
averaged with ours.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from agentflow.errors import UnknownNameError

PLAYERS = "Human reference"
"""Published "model" that stands for experienced players."""


@dataclass(frozen=True)
class Published:
    """One published number."""

    table: str
    task: str
    model: str
    condition: str
    metric: str
    value: str
    """As printed: "5", "46/50", "97.87%"."""


@cache
def published() -> tuple[Published, ...]:
    """All published numbers, in the order of published_results.csv."""
    text = (files("agentflow.metrics") / "published_results.csv").read_text(encoding="utf-8")
    return tuple(Published(**row) for row in csv.DictReader(text.splitlines()))


def check_source(table: str) -> None:
    """Raise UnknownNameError unless there is such a published table."""
    known = dict.fromkeys(item.table for item in published())
    if table not in known:
        raise UnknownNameError("published table", table, known)


def player_means() -> dict[str, float]:
    """Task -> mean score of experienced players, on the game's scale."""
    return {
        item.task: float(item.value)
        for item in published()
        if item.model == PLAYERS and item.metric == "mean"
    }
