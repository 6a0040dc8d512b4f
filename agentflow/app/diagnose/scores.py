"""Shares of right answers, and how well something is detected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from agentflow.metrics.validity import Rate


@dataclass(frozen=True)
class Detection:
    """How many of the true things were named, and how many of the named things are true."""

    found: int
    """Both true and named."""
    named: int
    true: int

    def __add__(self, other: Detection) -> Detection:
        return Detection(self.found + other.found, self.named + other.named, self.true + other.true)

    @property
    def recall(self) -> Rate:
        """Found / true."""
        return Rate(self.found, self.true)

    @property
    def precision(self) -> Rate:
        """Found / named."""
        return Rate(self.found, self.named)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of recall and precision; None if nothing is true and nothing named."""
        both = self.named + self.true
        return 2 * self.found / both if both else None

    def to_json(self) -> dict[str, Any]:
        """The numbers as JSON data; the recall is called accuracy, as in the published table."""
        return {
            "found": self.found,
            "named": self.named,
            "accuracy": self.recall.value,
            "interval": self.recall.interval,
            "precision": self.precision.value,
            "f1": self.f1,
        }


def rate_json(rate: Rate) -> dict[str, Any]:
    """A share with its Wilson interval as JSON data."""
    return {
        "share": rate.value,
        "count": rate.count,
        "of": rate.of,
        "interval": rate.interval,
    }
