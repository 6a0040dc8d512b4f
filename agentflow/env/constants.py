"""Owns the physical constants: loads the one data file, which gives unit and source of each.

What belongs to a block of the library (mass, size, drag) is the machine language's.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from agentflow.errors import UnknownNameError


@dataclass(frozen=True)
class Constants:
    """Values by name; some differ between block types."""

    values: Mapping[str, float]
    by_type: Mapping[str, Mapping[int, float]]
    digest: str
    """Hash of the data file's content, 16 hex digits; stored in every rollout."""

    def __getitem__(self, name: str) -> float:
        """The general value of a constant.

        Raises:
            UnknownNameError: There is no constant of that name.
        """
        if name not in self.values:
            raise UnknownNameError("physical constant", name, self.values)
        return self.values[name]

    def of(self, name: str, block_type: int) -> float:
        """The value for one block type: its own where it has one, else the general value."""
        return self.by_type.get(name, {}).get(block_type, self[name])


@cache
def constants() -> Constants:
    """The constants of `constants.json`."""
    text = files("agentflow.env").joinpath("constants.json").read_text(encoding="utf-8")
    data = json.loads(text)
    content = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return Constants(
        values={name: float(entry["value"]) for name, entry in data.items()},
        by_type={
            name: {int(kind): float(value) for kind, value in entry["by_type"].items()}
            for name, entry in data.items()
            if "by_type" in entry
        },
        digest=hashlib.sha256(content.encode()).hexdigest()[:16],
    )
