"""Owns how often what models write is valid: parse, spatial, machine (spec 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from agentflow.metrics.intervals import Interval, wilson
from agentflow.metrics.records import CandidateRecord


@dataclass(frozen=True)
class Rate:
    """A share as a count of a count."""

    count: int
    of: int

    @property
    def value(self) -> float | None:
        """From 0 to 1; None of nothing."""
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
    """How many were valid, each of the same number."""

    parse: Rate
    """Replies in the demanded format."""
    spatial: Rate
    """... whose machine had no overlaps and kept its size."""
    machine: Rate
    """... and was what was asked for in every respect."""


def first_attempts(candidates: Sequence[CandidateRecord]) -> Validity:
    """Validity at the first attempt, before any retry, one per trajectory (spec 5.2)."""
    total = len(candidates)
    return Validity(
        Rate(sum(c.parsed_first for c in candidates), total),
        Rate(sum(c.spatial_first for c in candidates), total),
        Rate(sum(c.valid_first for c in candidates), total),
    )


def after_retries(candidates: Sequence[CandidateRecord]) -> Rate:
    """Trajectories with a valid machine at the end of a stage."""
    return Rate(sum(c.valid for c in candidates), len(candidates))
