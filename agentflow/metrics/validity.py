"""Validity rates of models' replies: parse, spatial, machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
        """Wilson's 95 % interval; see `wilson`."""
        return wilson(self.count, self.of)

    def __add__(self, other: Rate) -> Rate:
        return Rate(self.count + other.count, self.of + other.of)

    def __str__(self) -> str:
        return f"{self.count}/{self.of}"


@dataclass(frozen=True)
class Validity:
    """Three validity rates of the same replies."""

    parse: Rate
    """Replies in the required format."""
    spatial: Rate
    """... whose machine has no overlaps and is within the size limit."""
    machine: Rate
    """... and meets every other requirement."""


def first_attempts(candidates: Sequence[CandidateEvent]) -> Validity:
    """Validity at the first attempt, before any retry, one per trajectory."""
    total = len(candidates)
    return Validity(
        Rate(sum(c.first.parsed for c in candidates), total),
        Rate(sum(c.first.spatial for c in candidates), total),
        Rate(sum(c.first.valid for c in candidates), total),
    )


def after_retries(candidates: Sequence[CandidateEvent]) -> Rate:
    """Trajectories with a valid machine at the end of a stage."""
    return Rate(sum(c.valid for c in candidates), len(candidates))
