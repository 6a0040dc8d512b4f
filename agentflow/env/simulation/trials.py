"""Combining the trials of one machine into one rollout, which shows one of them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from agentflow.env.rollout import Feedback, Rollout

SUCCESS, OUTCOME, MISS = "success", "outcome", "miss"
"""Terms of every trial: whether it succeeded, a phrase on its outcome, and by how many metres it
missed success (None if it succeeded or no distance applies)."""
SHOWN_TRIAL = "shown_trial"
"""Term of the combined rollout: number of the trial whose trace, scene and events it shows."""
DIVERGED = "the simulation diverged"


def combine_trials(played: Sequence[Rollout]) -> Rollout:
    """Combine the rollouts of all trials, in order; a single one is returned unchanged.

    The score is the number of successful trials. A trial that diverged has failed; the combined
    rollout has diverged if all trials have. Terms and feedback cover every trial. Trace, scene,
    breakages and events are those of one trial: the first that failed, or else the first. The
    digest covers all, and marginal connections are those of all. If a trial is invalid, timed out
    or crashed, the first such trial is returned unchanged.

    Args:
        played: At least one; all of one machine at one task's trials.
    """
    if len(played) == 1:
        return played[0]
    stopped = (rollout for rollout in played if rollout.status not in ("ok", "diverged"))
    return next(stopped, None) or _combine_scored(played)


def _combine_scored(played: Sequence[Rollout]) -> Rollout:
    wins = [rollout.terms.get(SUCCESS) is True for rollout in played]
    index = wins.index(False) if False in wins else 0
    shown, score = played[index], float(sum(wins))
    terms: dict[str, float | bool | str | None] = {
        "successes": score,
        "trials": float(len(played)),
        SHOWN_TRIAL: float(index + 1),
    }
    misses = [miss for miss in (rollout.terms.get(MISS) for rollout in played) if miss is not None]
    terms["closest_miss"] = min(map(float, misses), default=None)
    for number, rollout in enumerate(played, start=1):
        terms[f"trial_{number}"] = rollout.terms.get(SUCCESS) is True
        terms[f"outcome_{number}"] = _outcome(rollout)
    return replace(
        shown,
        status="diverged" if all(rollout.status == "diverged" for rollout in played) else "ok",
        score=score,
        terms=terms,
        feedback=_feedback(played, score, index),
        marginal=tuple(item for rollout in played for item in rollout.marginal),
        digest=_digest(played),
        sim_seconds=sum(rollout.sim_seconds or 0.0 for rollout in played),
        wall_seconds=sum(rollout.wall_seconds or 0.0 for rollout in played),
    )


def _outcome(rollout: Rollout) -> str:
    return DIVERGED if rollout.status == "diverged" else str(rollout.terms[OUTCOME])


def _feedback(played: Sequence[Rollout], score: float, index: int) -> Feedback:
    """A line for every trial, then the feedback of the one shown."""
    shown = played[index].feedback
    text = [
        f"Score: {score:.2f} successful trials out of {len(played)}",
        *(f"Trial {n}: {_outcome(rollout)}" for n, rollout in enumerate(played, start=1)),
        f"Everything below is about trial {index + 1}.",
        *(line for line in shown.text.splitlines() if not line.startswith(("Score:", "Result:"))),
    ]
    trials: list[dict[str, Any]] = [
        {**rollout.terms, OUTCOME: _outcome(rollout)} for rollout in played
    ]
    data = {**shown.data, "score": score, "trials": trials, SHOWN_TRIAL: index + 1}
    return Feedback("\n".join(text), data)


def _digest(played: Sequence[Rollout]) -> str:
    """Hash of the digests in order; equal only when every trial is bitwise equal."""
    digests = [str(rollout.digest) for rollout in played]
    return hashlib.sha256("\n".join(digests).encode()).hexdigest()[:32]
