"""The physical constants of `constants.json`, which gives the unit and source of each.

Mass, size and drag of blocks are in the block library.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files

from agentflow.errors import UnknownNameError


@dataclass(frozen=True)
class Constants:
    """Values by name; some differ between block types."""

    values: Mapping[str, float]
    by_type: Mapping[str, Mapping[int, float]]
    units: Mapping[str, str]

    @cached_property
    def digest(self) -> str:
        """Hash of all values and units, 16 hex digits; stored in every rollout."""
        content = {
            name: [value, self.units[name], sorted(self.by_type.get(name, {}).items())]
            for name, value in self.values.items()
        }
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def __getitem__(self, name: str) -> float:
        """The general value of a constant.

        Raises:
            UnknownNameError: There is no constant of that name.
        """
        if name not in self.values:
            raise UnknownNameError("physical constant", name, self.values)
        return self.values[name]

    def of(self, name: str, block_type: int) -> float:
        """The value for one block type: its own if it has one, else the general value."""
        return self.by_type.get(name, {}).get(block_type, self[name])

    def changed(self, values: Mapping[str, float]) -> Constants:
        """The constants with other values, for fitting and experiments.

        Args:
            values: By name; append a block type to change its own value: "motor_speed.22".

        Raises:
            UnknownNameError: There is no constant of that name.
        """
        general = dict(self.values)
        by_type = {name: dict(own) for name, own in self.by_type.items()}
        for key, value in values.items():
            name, _, kind = key.partition(".")
            _ = self[name]
            if kind:
                by_type.setdefault(name, {})[int(kind)] = value
            else:
                general[name] = value
        return Constants(general, by_type, self.units)


@cache
def constants() -> Constants:
    """The constants of `constants.json`."""
    text = files("agentflow.env").joinpath("constants.json").read_text(encoding="utf-8")
    data = json.loads(text)
    return Constants(
        values={name: float(entry["value"]) for name, entry in data.items()},
        by_type={
            name: {int(kind): float(value) for kind, value in entry["by_type"].items()}
            for name, entry in data.items()
            if "by_type" in entry
        },
        units={name: entry["unit"] for name, entry in data.items()},
    )
