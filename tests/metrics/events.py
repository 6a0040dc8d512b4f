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
from agentflow.runs.locations import FEEDBACK, Location


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
        Location(stage, trajectory=trajectory),
        trajectory=trajectory,
        machine=machine if valid else None,
        valid=valid,
        score=score,
        first=FirstAttempt("p" in first, "s" in first, "v" in first),
        reason="" if valid else "why",
    )


def attempt(label: str, tokens: int = 0, **data: Any) -> AttemptEvent:
    location = Location.parse(label)
    known = {
        "role": location.name.partition("/")[0],
        "valid": True,
        "parsed": True,
        "spatial": True,
    }
    known |= {"repaired": False, "code": "", "problem": ""}
    known |= {"script": ""} if known["role"] == "refiner" and "machine" in data else {}
    return AttemptEvent(location, **{**known, "tokens": tokens, **data})


def expansion(trajectory: int, round_: int, verdicts: str) -> ExpandEvent:
    """`verdicts`: v for each valid attempt, x for each refused one."""
    attempts = tuple(ExpandAttempt("", verdict == "v", "") for verdict in verdicts)
    location = Location(FEEDBACK, trajectory=trajectory, round=round_)
    return ExpandEvent(location, 0, attempts, (), fallback="v" not in verdicts)


def node(
    trajectory: int, id_: int, round_: int, score: float | None, valid: bool = True
) -> NodeEvent:
    location = Location(FEEDBACK, trajectory=trajectory, node=id_)
    return NodeEvent(location, round_, 0, "", "00", valid, score)


def evaluation(
    label: str, score: float | None, machine: str = "00", **data: Any
) -> EvaluationEvent:
    known = {"valid": True, "status": "ok", "broken": (), "rollout": "11", "moved": 1.0}
    return EvaluationEvent(Location.parse(label), machine, score=score, **{**known, **data})


def edit(trajectory: int, round_: int, machine: str = "00", kept: bool = True) -> EditEvent:
    location = Location(FEEDBACK, trajectory=trajectory, round=round_)
    return EditEvent(location, "?", machine, kept)
