"""Ranges of numbers in YAML files, written `2..5`, and random numbers from them."""

import re
from collections.abc import Mapping
from random import Random
from typing import Any

_RANGE = re.compile(r"(-?[0-9]+(?:\.[0-9]+)?)\.\.(-?[0-9]+(?:\.[0-9]+)?)")


def ends_of(value: object) -> tuple[str, str] | None:
    """The ends of a range as they are written; None of anything else."""
    found = _RANGE.fullmatch(value) if isinstance(value, str) else None
    return (found[1], found[2]) if found else None


def draw_numbers(data: Any, rng: Random) -> Any:
    """A copy of data with a number in place of each range.

    It is whole if both ends are, as in `2..5`; of `2.0..5.0`, it has three significant digits.
    """
    if isinstance(data, Mapping):
        return {key: draw_numbers(value, rng) for key, value in data.items()}
    if isinstance(data, list):
        return [draw_numbers(value, rng) for value in data]
    if (ends := ends_of(data)) is None:
        return data
    if "." not in "".join(ends):
        return rng.randint(int(ends[0]), int(ends[1]))
    return float(f"{rng.uniform(float(ends[0]), float(ends[1])):.3g}")
