"""Designs with several seeds, one run after another, and keeps the best."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from agentflow.app.design.run import RunOptions, design
from agentflow.config.run import DesignConfig
from agentflow.errors import AgentflowError, EndpointError, FamilyError, RunError

KEYS = ("seed", "score", "best_stage", "calls", "seconds", "run")
"""What the summary says about each run, besides `verified` and `failed`."""
FAULTS = (EndpointError, RunError, FamilyError)
"""Errors that end one run; any other would end all of them alike."""


def design_seeds(
    config: DesignConfig,
    out: Path,
    count: int,
    minutes: float | None,
    options: RunOptions,
    clock: Callable[[], float] = time.monotonic,
) -> dict[str, Any]:
    """Carry out one run per seed; the result of the best run, with `seeds`, a row for each run.

    A run that fails does not stop the others. In its row, `failed` says why, which is "" for the
    others, and all else but the seed is None.

    Args:
        config: What to do; its seed is the first.
        out: Parent folder of the run directories.
        count: Number of seeds.
        minutes: Time after which no further run begins; a run in progress is finished.
        options: How to do it.
        clock: The time, s.

    Raises:
        EndpointError, RunError: Every run failed; an EndpointError if all failed because of the
            endpoint.
        UsageError, InterruptedRunError: As `design` does; earlier runs are kept.
    """
    end = float("inf") if minutes is None else clock() + 60 * minutes
    finished: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    faults: list[AgentflowError] = []
    for seed in range(config.seed, config.seed + count):
        if rows and clock() >= end:
            options.notify(f"{minutes:g} minutes are over: {count - len(rows)} seeds not run")
            break
        options.notify(f"seed {seed}: run {len(rows) + 1} of {count}")
        try:
            result = design(config.model_copy(update={"seed": seed}), out, options)
        except FAULTS as error:
            faults.append(error)
            rows.append(_failed_row(seed, error))
            options.notify(f"seed {seed} failed: {rows[-1]['failed']}")
        else:
            finished.append(result)
            rows.append(_row(result))
    if not finished:
        raise _failure(rows, faults)
    best = max(finished, key=_rank)
    return {**best, "seeds": rows}


def _row(result: dict[str, Any]) -> dict[str, Any]:
    verified = (result.get("verified") or {}).get("score")
    return {**{key: result[key] for key in KEYS}, "verified": verified, "failed": ""}


def _failed_row(seed: int, error: AgentflowError) -> dict[str, Any]:
    unknown = dict.fromkeys((*KEYS, "verified"))
    return {**unknown, "seed": seed, "failed": str(error).strip().partition("\n")[0]}


def _failure(rows: list[dict[str, Any]], faults: list[AgentflowError]) -> AgentflowError:
    """The error of a series in which every run failed."""
    kind = EndpointError if all(isinstance(error, EndpointError) for error in faults) else RunError
    told = "; ".join(f"seed {row['seed']}: {row['failed']}" for row in rows)
    return kind(f"no run finished: {told}")


def _rank(result: dict[str, Any]) -> tuple[float, float]:
    """Verified score, then score; runs without one come last. Of equal runs, the first counts."""
    row = _row(result)
    verified, score = (
        float("-inf") if row[key] is None else float(row[key]) for key in ("verified", "score")
    )
    return verified, score
