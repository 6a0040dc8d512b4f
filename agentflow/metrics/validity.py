"""Validity rates of models' replies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from agentflow.metrics.intervals import Interval, wilson
from agentflow.runs.events import CandidateEvent


@dataclass(frozen=True)
class Rate:
    """A share, as `count` of `of`."""

    count: int
    of: int

    @property
    def value(self) -> float | None:
        """From 0 to 1; None if `of` is 0."""
        return self.count / self.of if self.of else None

    @property
    def interval(self) -> Interval | None:
        """Wilson's 95 % interval."""
        return wilson(self.count, self.of)

    def to_json(self) -> dict[str, Any]:
        """The share with its interval as JSON data."""
        return {"count": self.count, "of": self.of, "share": self.value, "interval": self.interval}

    def __add__(self, other: Rate) -> Rate:
        return Rate(self.count + other.count, self.of + other.of)

    def __str__(self) -> str:
        return f"{self.count}/{self.of}"


def first_attempts(
    candidates: Sequence[CandidateEvent], level: Literal["parsed", "spatial", "valid"]
) -> Rate:
    """Trajectories whose first attempt, before any retry, got this far; see `FirstAttempt`."""
    return Rate(sum(getattr(c.first, level) for c in candidates), len(candidates))


def after_retries(candidates: Sequence[CandidateEvent]) -> Rate:
    """Trajectories with a valid machine at the end of a stage."""
    return Rate(sum(c.valid for c in candidates), len(candidates))
