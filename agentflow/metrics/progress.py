"""Owns the curve of a run: its best score against what had been spent by then."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from agentflow.runs import Event


@dataclass(frozen=True)
class Progress:
    """A point of the curve, after one evaluation."""

    evaluations: int
    expansions: int
    """Expansions of search trees, or random edits."""
    calls: int
    tokens: int
    """As reported by the endpoint; 0 where it reports none."""
    seconds: float
    """Of work into the run."""
    score: float | None
    """Of this evaluation; None when the computer failed."""
    best: float | None
    """Of all so far."""


def progress(events: Iterable[Event]) -> Iterator[Progress]:
    """One point per evaluation, in the order in which they happened."""
    evaluations = expansions = calls = tokens = 0
    best: float | None = None
    for event in events:
        if event.kind == "attempt":
            calls += 1
            tokens += event.data["tokens"]
        elif event.kind in ("expand", "edit"):
            expansions += 1
        elif event.kind == "evaluation":
            evaluations += 1
            score = event.data["score"]
            if score is not None and event.data["valid"]:
                best = score if best is None else max(best, score)
            yield Progress(evaluations, expansions, calls, tokens, event.at, score, best)
