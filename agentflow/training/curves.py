"""The numbers that training runs log, by dotted names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

OF_SAMPLES = "eval."
"""Before the names of numbers of the samples taken between steps: eval.TASK.NAME."""
MOST = 1e300
"""Largest number that counts."""


def flatten(row: Mapping[str, Any], above: str = "") -> dict[str, float]:
    """The numbers of a logged step and of the groups in it: `eval.throwing.mean`.

    Texts, lists, and values that are missing, infinite or undefined are left out.
    """
    found: dict[str, float] = {}
    for key, value in row.items():
        if isinstance(value, Mapping):
            found |= flatten(value, f"{above}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and _is_finite(value):
            found[f"{above}{key}"] = value
    return found


def _is_finite(value: float) -> bool:
    """Whether a number, perhaps a very large integer, can be drawn."""
    return -MOST <= value <= MOST
