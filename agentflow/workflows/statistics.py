"""Statistics of stages: rows of the stage table, passes, the best machine, the Pareto front."""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from typing import Any

from agentflow.machine.tree import Machine
from agentflow.search.node import Evaluation
from agentflow.search.pareto import ranks
from agentflow.search.tree import is_better
from agentflow.workflows.base import Candidate, Stage

PASS = 1.0
"""Lowest score that counts as a success."""


def stage_row(stage: Stage) -> dict[str, Any]:
    """The stage as one row of the table, over all trajectories of the run.

    `mean`, `max` and `std` (of the population) are over the valid machines; `mean_all` counts
    invalid ones as 0; neither includes failed simulations. They are None without machines.
    `parsed_first`, `spatial_first` and `valid_first` count first attempts (in the feedback loop,
    the first of each search), `valid` counts machines after the retries. `tools` is there if
    tools were called.
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
        **({"tools": stage.tools} if stage.tools else {}),
    }


def count_passes(stage: Stage) -> dict[str, Any]:
    """Number of attempts of a stage that parsed, were spatially valid, and passed.

    An attempt passes with a score of at least 1, which is what pass-or-fail tasks give for a
    success. Attempts whose simulation failed are not counted.
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


def find_best(stages: tuple[Stage, ...]) -> tuple[Candidate, Stage] | None:
    """The valid machine with the highest reward, the earliest if tied; None without one."""
    best: tuple[Candidate, Stage] | None = None
    for stage in stages:
        for candidate in stage.survivors:
            found, earlier = candidate.evaluation, best and best[0].evaluation
            if candidate.reward is None or found is None:
                continue
            if earlier is None or is_better(found, earlier):
                best = candidate, stage
    return best


def pareto_front(
    found: Iterable[tuple[Machine, Evaluation]],
) -> tuple[tuple[Machine, Evaluation], ...]:
    """The machines that no other dominates, by falling reward; none without objectives."""
    compared = [(machine, result) for machine, result in found if result.objectives]
    fronts = ranks([result.objectives or () for _, result in compared])
    first = [pair for pair, front in zip(compared, fronts, strict=True) if front == 1]
    return tuple(sorted(first, key=lambda pair: (-(pair[1].reward or 0.0), pair[0].digest)))
