"""Owns the numbers of a stage, as they stand in the stage table (spec 5.2)."""

from __future__ import annotations

import statistics
from typing import Any

from agentflow.workflows.base import Candidate, Stage

PASS = 1.0
"""Score of a success."""


def row(stage: Stage) -> dict[str, Any]:
    """The stage as one row of the table, over all trajectories of the run.

    `mean`, `max` and `std` (of the population) are over the valid machines, `mean_all` counts the
    invalid ones as 0. Machines that the computer could not score are in neither. None where there
    is nothing to average. `parsed_first`, `spatial_first`, `valid_first` count first attempts,
    `valid` what there is after the retries; in the feedback loop the first attempt is the first of
    each search and `valid` counts the trees.
    """
    candidates = stage.candidates
    valid = [c.score for c in candidates if c.valid and c.score is not None]
    invalid = [0.0 for c in candidates if not c.valid]
    return {
        "name": stage.name,
        "trajectories": len(candidates),
        "parsed_first": sum(c.first.parsed for c in candidates),
        "spatial_first": sum(c.first.spatial for c in candidates),
        "valid_first": sum(c.first.valid for c in candidates),
        "valid": sum(c.valid for c in candidates),
        "mean": statistics.fmean(valid) if valid else None,
        "mean_all": statistics.fmean(valid + invalid) if valid or invalid else None,
        "max": max(valid, default=None),
        "std": statistics.pstdev(valid) if valid else None,
        "calls": stage.calls,
        "tokens": stage.tokens,
        "rollouts": stage.rollouts,
        "expansions": sum(c.search_cost.expansions for c in candidates),
        "attempts": sum(c.search_cost.attempts for c in candidates),
        "children": sum(c.search_cost.valid for c in candidates),
    }


def passes(stage: Stage) -> dict[str, Any]:
    """How many attempts of a stage got how far.

    An attempt passes when it scores at least 1, which is what a task with success or failure
    gives for success. Attempts that the computer could not score are not counted.
    """
    scored = [c for c in stage.candidates if not c.valid or c.score is not None]
    count = sum(c.valid and c.score is not None and c.score >= PASS for c in scored)
    return {
        "attempts": len(scored),
        "parsed": sum(c.first.parsed for c in scored),
        "spatial": sum(c.first.spatial for c in scored),
        "passes": count,
        "share": count / len(scored) if scored else None,
    }


def best_of(stages: tuple[Stage, ...]) -> tuple[Candidate, Stage] | None:
    """The valid machine with the highest score; the earliest among equals; None without one."""
    found: tuple[Candidate, Stage] | None = None
    highest: float | None = None
    for stage in stages:
        for candidate in stage.survivors:
            score = candidate.score
            if score is not None and (highest is None or score > highest):
                found, highest = (candidate, stage), score
    return found
