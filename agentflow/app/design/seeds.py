"""Designs with several seeds, one run after another, and keeps the best."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from agentflow.app.design.run import RunOptions, design
from agentflow.config.run import DesignConfig

KEYS = ("seed", "score", "best_stage", "calls", "seconds", "run")
"""What the summary says about each run."""


def design_seeds(
    config: DesignConfig,
    out: Path,
    count: int,
    minutes: float | None,
    options: RunOptions,
    clock: Callable[[], float] = time.monotonic,
) -> dict[str, Any]:
    """Carry out one run per seed; the result of the best run, with `seeds`, a row for each run.

    Args:
        config: What to do; its seed is the first.
        out: Parent folder of the run directories.
        count: Number of seeds.
        minutes: Time after which no further run begins; a run in progress is finished.
        options: How to do it.
        clock: The time, s.

    Raises:
        UsageError, EndpointError, InterruptedRunError: As `design` does; earlier runs are kept.
    """
    end = float("inf") if minutes is None else clock() + 60 * minutes
    results: list[dict[str, Any]] = []
    for seed in range(config.seed, config.seed + count):
        if results and clock() >= end:
            options.notify(f"{minutes:g} minutes are over: {count - len(results)} seeds not run")
            break
        options.notify(f"seed {seed}: run {len(results) + 1} of {count}")
        results.append(design(config.model_copy(update={"seed": seed}), out, options))
    best = max(results, key=_rank)
    return {**best, "seeds": [_row(result) for result in results]}


def _row(result: dict[str, Any]) -> dict[str, Any]:
    verified = (result.get("verified") or {}).get("score")
    return {**{key: result[key] for key in KEYS}, "verified": verified}


def _rank(result: dict[str, Any]) -> tuple[float, float]:
    """Verified score, then score; runs without one come last. Of equal runs, the first counts."""
    row = _row(result)
    verified, score = (
        float("-inf") if row[key] is None else float(row[key]) for key in ("verified", "score")
    )
    return verified, score
