"""Combining the trials of one machine into one rollout, which shows one of them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from agentflow.env.rollout import Feedback, Rollout
from agentflow.env.simulation.requirements import apply, worst
from agentflow.env.tasks.base import Task
from agentflow.env.tasks.knobs import knobs_of

SUCCESS, OUTCOME, MISS = "success", "outcome", "miss"
"""Terms of every trial: whether it succeeded, a phrase on its outcome, and by how many metres it
missed success (None if it succeeded or no distance applies)."""
BROKE = "first_break"
"""What the data of feedback add to these: block, partner and time of the first break, if any."""
RESULT = "Result: "
"""How the line of a trial's feedback begins that says its outcome."""
SHOWN_TRIAL = "shown_trial"
"""Term of the combined rollout: number of the trial whose trace, scene and events it shows."""
FIGURE = re.compile(r"(?<=\s)-?\d+(?:\.\d+|(?=%))")
"""A measured number in an outcome; numbers of blocks and walls have neither decimals nor "%"."""
DIVERGED = "the simulation diverged"


def middle_trial(trials: Sequence[Task]) -> int:
    """Index of the trial whose conditions are nearest the middle of those of all trials.

    It depends on the seed alone, so feedback on different machines is about the same conditions.
    """
    knobs = knobs_of(type(trials[0].parameters))
    names = [knob.name for knob in knobs if isinstance(knob.default, int | float)]
    values = np.array([[attrgetter(name)(each.parameters) for name in names] for each in trials])
    spread = np.ptp(values, axis=0)
    away = np.abs(values - np.median(values, axis=0)) / np.where(spread > 0.0, spread, 1.0)
    return int(away.sum(axis=1).argmin())


def combine_trials(played: Sequence[Rollout], trials: Sequence[Task]) -> Rollout:
    """Combine the rollouts of all trials, in order; a single one is returned unchanged.

    The score is the number of successful trials. A trial that diverged has failed; the combined
    rollout has diverged if all trials have. Terms and feedback cover every trial. Trace, scene,
    breakages and events are those of the middle trial (`middle_trial`), the same for every machine.
    The digest covers all, and marginal connections are those of all. If a trial is invalid, timed
    out or crashed, the first such trial is returned unchanged.

    Args:
        played: At least one; all of one machine at one task's trials.
        trials: The task's trials.
    """
    if len(played) == 1:
        return played[0]
    stopped = (rollout for rollout in played if rollout.status not in ("ok", "diverged"))
    combined = next(stopped, None) or _combine_scored(played, middle_trial(trials))
    return apply(combined, trials[0].brief) if combined.requirements else combined


def _combine_scored(played: Sequence[Rollout], index: int) -> Rollout:
    shown = played[index]
    score = float(sum(rollout.terms.get(SUCCESS) is True for rollout in played))
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
        requirements=worst([rollout.requirements for rollout in played]),
        digest=_digest(played),
        sim_seconds=sum(rollout.sim_seconds or 0.0 for rollout in played),
        wall_seconds=sum(rollout.wall_seconds or 0.0 for rollout in played),
    )


def _outcome(rollout: Rollout) -> str:
    return DIVERGED if rollout.status == "diverged" else str(rollout.terms[OUTCOME])


def _feedback(played: Sequence[Rollout], score: float, index: int) -> Feedback:
    """The outcome of every trial, then the feedback of the one shown."""
    shown, outcomes = played[index].feedback, [_outcome(rollout) for rollout in played]
    lines = _trial_lines(outcomes)
    told = ("Score:", RESULT) if f"Trial {index + 1}: {outcomes[index]}" in lines else ("Score:",)
    text = [
        f"Score: {score:.2f} successful trials out of {len(played)}",
        *lines,
        f"Everything below is about trial {index + 1}, whose conditions are the middle ones:",
        *(line for line in shown.text.splitlines() if not line.startswith(told)),
    ]
    trials: list[dict[str, Any]] = [
        {
            **rollout.terms,
            OUTCOME: outcome,
            BROKE: next(([b.block, b.partner, b.time] for b in rollout.broken), None),
        }
        for rollout, outcome in zip(played, outcomes, strict=True)
    ]
    data = {**shown.data, "score": score, "trials": trials, SHOWN_TRIAL: index + 1}
    return Feedback("\n".join(text), data)


def _trial_lines(outcomes: Sequence[str]) -> list[str]:
    """One line for all trials whose outcomes differ only in numbers, which are shown as ranges."""
    alike: dict[str, list[int]] = {}
    for index, outcome in enumerate(outcomes):
        alike.setdefault(FIGURE.sub("#", outcome), []).append(index)
    lines = []
    for indices in alike.values():
        columns = zip(*(FIGURE.findall(outcomes[index]) for index in indices), strict=True)
        spans = iter([_span(column) for column in columns])
        text = FIGURE.sub(lambda _, spans=spans: next(spans), outcomes[indices[0]])  # type: ignore[misc]
        name = "Trials" if len(indices) > 1 else "Trial"
        whole = f"All {len(outcomes)} trials" if len(indices) == len(outcomes) > 1 else ""
        numbers = ", ".join(str(index + 1) for index in indices)
        lines.append(f"{whole or f'{name} {numbers}'}: {text}")
    return lines


def _span(figures: Sequence[str]) -> str:
    low, high = min(figures, key=float), max(figures, key=float)
    return low if low == high else f"{low} to {high}"


def _digest(played: Sequence[Rollout]) -> str:
    """Hash of the digests in order; equal only when every trial is bitwise equal."""
    digests = [str(rollout.digest) for rollout in played]
    return hashlib.sha256("\n".join(digests).encode()).hexdigest()[:32]
