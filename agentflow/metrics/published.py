"""Published results of other models, for comparison.

They were measured in the game, not in this simulator, so they are always labelled and never
averaged with ours.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType

from agentflow.errors import UnknownNameError

PLAYERS = "Human reference"
"""Published "model" that stands for experienced players."""

BUILDARENA = (
    "Published rows: BuildArena (arXiv:2510.16559), leaderboard in the README of its repository, "
    "AI4Science-WestlakeU/BuildArena. Each number is a mean over three levels with 64 samples "
    "each; the intervals are computed here, for these 192 samples. Levels 1 to 3 of bridge, "
    "transport and rocket are modelled on its Support, Transport and Lift, which have no levels 4 "
    "and 5. There are four differences: in BuildArena, five agents make each machine; Transport "
    "succeeds more than 10 m from the start (here: within 1 m of the target); the first level of "
    "Lift succeeds by computed thrust (here: measured); and Support has no rule against touching "
    "the floor."
)
SOURCES: Mapping[str, str] = MappingProxyType({"buildarena": BUILDARENA})
"""Published table -> source and differences, for tables that are not of arXiv:2510.14980."""


@dataclass(frozen=True)
class Published:
    """One published number."""

    table: str
    task: str
    model: str
    condition: str
    metric: str
    value: str
    """As printed: "5", "46/50", "97.87%"; only the intervals of `buildarena` are computed."""

    @property
    def tasks(self) -> frozenset[str]:
        """The tasks that it is of: three of "bridge/1-3", which is a mean over levels."""
        family, _, levels = self.task.partition("/")
        first, dash, last = levels.partition("-")
        if not dash:
            return frozenset((self.task,))
        return frozenset(f"{family}/{level}" for level in range(int(first), int(last) + 1))


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
