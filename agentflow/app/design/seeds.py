"""Designs with several seeds, one run after another, and keeps the best."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agentflow.app.design.run import RunOptions, design
from agentflow.config.run import DesignConfig
from agentflow.errors import AgentflowError, EndpointError, PluginError, RunError
from agentflow.runs import RunResult

KEYS = ("seed", "score", "best_stage", "calls", "seconds", "run")
"""What the summary says about each run, besides `verified`, `fragile` and `failed`."""
FAULTS = (EndpointError, RunError, PluginError)
"""Errors that end one run; any other would end all of them alike."""


@dataclass(frozen=True)
class SeedsResult:
    """The result of the best of several runs, and a row for each run."""

    best: RunResult
    rows: Sequence[Mapping[str, Any]]
    """`KEYS`, `verified`, `fragile` and `failed`: why the run failed, or ""; all else but the seed
    is then None."""

    def to_json(self) -> dict[str, Any]:
        """The best result, with the rows as `seeds`."""
        return {**self.best.to_json(), "seeds": list(self.rows)}


def design_seeds(
    config: DesignConfig,
    out: Path,
    count: int,
    minutes: float | None,
    options: RunOptions,
    clock: Callable[[], float] = time.monotonic,
) -> SeedsResult:
    """Carry out one run per seed; a run that fails does not stop the others.

    Args:
        config: What to do; its seed is the first.
        out: Parent folder of the run directories.
        count: Number of seeds.
        minutes: Time after which no more runs start; a run in progress is finished.
        options: How to do it.
        clock: The time, s.

    Raises:
        EndpointError, RunError: Every run failed; an EndpointError if all failed because of the
            endpoint.
        UsageError, InterruptedRunError: As `design` does; earlier runs are kept.
    """
    end = float("inf") if minutes is None else clock() + 60 * minutes
    found: dict[int, RunResult | AgentflowError] = {}
    for seed in range(config.seed, config.seed + count):
        if found and clock() >= end:
            options.notify(f"{minutes:g} minutes are over: {count - len(found)} seeds not run")
            break
        options.notify(f"seed {seed}: run {len(found) + 1} of {count}")
        try:
            found[seed] = design(config.model_copy(update={"seed": seed}), out, options)
        except FAULTS as error:
            found[seed] = error
            options.notify(f"seed {seed} failed: {_row(seed, error)['failed']}")
    rows = [_row(*item) for item in found.items()]
    finished = [one for one in found.values() if isinstance(one, RunResult)]
    if not finished:
        at_endpoint = all(isinstance(one, EndpointError) for one in found.values())
        told = "; ".join(f"seed {row['seed']}: {row['failed']}" for row in rows)
        raise (EndpointError if at_endpoint else RunError)(f"no run finished: {told}")
    return SeedsResult(max(finished, key=_rank), rows)


def _row(seed: int, found: RunResult | AgentflowError) -> dict[str, Any]:
    if isinstance(found, AgentflowError):
        unknown = dict.fromkeys((*KEYS, "verified", "fragile"))
        return {**unknown, "seed": seed, "failed": str(found).strip().partition("\n")[0]}
    known = {key: getattr(found, key) for key in KEYS}
    return {**known, "verified": found.verified_score, "fragile": found.fragile, "failed": ""}


def _rank(result: RunResult) -> tuple[float, ...]:
    """Verified score, then score; runs without one come last. Among equal runs, the first
    counts."""
    found = (result.verified_score, result.score)
    return tuple(float("-inf") if score is None else score for score in found)
