"""Events as workflows write them, for metrics to read."""

from __future__ import annotations

from typing import Any

from agentflow.runs.events import (
    AttemptEvent,
    CandidateEvent,
    EditEvent,
    EvaluationEvent,
    ExpandAttempt,
    ExpandEvent,
    FirstAttempt,
    NodeEvent,
)
from agentflow.runs.places import FEEDBACK, Place


def candidate(
    stage: str,
    trajectory: int,
    score: float | None,
    valid: bool = True,
    first: str = "psv",
    machine: str = "00",
) -> CandidateEvent:
    """`first`: which of parsed, spatial, valid the first attempt was."""
    return CandidateEvent(
        Place(stage, trajectory=trajectory),
        trajectory=trajectory,
        machine=machine if valid else None,
        valid=valid,
        score=score,
        first=FirstAttempt("p" in first, "s" in first, "v" in first),
        reason="" if valid else "why",
    )


def attempt(label: str, tokens: int = 0, **data: Any) -> AttemptEvent:
    place = Place.parse(label)
    known = {"role": place.name.partition("/")[0], "valid": True, "parsed": True, "spatial": True}
    known |= {"repaired": False, "code": "", "problem": ""}
    known |= {"script": ""} if known["role"] == "refiner" and "machine" in data else {}
    return AttemptEvent(place, **{**known, "tokens": tokens, **data})


def expansion(trajectory: int, round_: int, verdicts: str) -> ExpandEvent:
    """`verdicts`: v for each valid attempt, x for each refused one."""
    attempts = tuple(ExpandAttempt("", verdict == "v", "") for verdict in verdicts)
    place = Place(FEEDBACK, trajectory=trajectory, round=round_)
    return ExpandEvent(place, 0, attempts, (), fallback="v" not in verdicts)


def node(
    trajectory: int, id_: int, round_: int, score: float | None, valid: bool = True
) -> NodeEvent:
    place = Place(FEEDBACK, trajectory=trajectory, node=id_)
    return NodeEvent(place, round_, 0, "", "00", valid, score)


def evaluation(
    label: str, score: float | None, machine: str = "00", **data: Any
) -> EvaluationEvent:
    known = {"valid": True, "status": "ok", "broken": (), "rollout": "11", "moved": 1.0}
    return EvaluationEvent(Place.parse(label), machine, score=score, **{**known, **data})


def edit(trajectory: int, round_: int, machine: str = "00", kept: bool = True) -> EditEvent:
    place = Place(FEEDBACK, trajectory=trajectory, round=round_)
    return EditEvent(place, "?", machine, kept)
