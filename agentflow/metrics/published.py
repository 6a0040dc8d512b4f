"""Published results of other models, for comparison.

They were measured in the game, not in this simulator, so they are always labelled and never
averaged with ours.
"""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType

from agentflow.errors import UnknownNameError

PLAYERS = "Human reference"
"""Published "model" that stands for experienced players."""

_HOME = files(__package__)
SOURCES: Mapping[str, str] = MappingProxyType(
    json.loads((_HOME / "published_sources.json").read_text("utf-8"))
)
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
    text = (_HOME / "published_results.csv").read_text(encoding="utf-8")
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
