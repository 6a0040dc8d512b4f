"""Events as workflows write them, for metrics to read."""

from __future__ import annotations

from typing import Any

from agentflow.runs import Event


def candidate(
    stage: str, trajectory: int, score: float | None, valid: bool = True, first: str = "psv"
) -> Event:
    """`first`: which of parsed, spatial, valid the first attempt was."""
    data = {
        "trajectory": trajectory,
        "machine": "00" if valid else None,
        "valid": valid,
        "score": score,
        "first": {"parsed": "p" in first, "spatial": "s" in first, "valid": "v" in first},
        "reason": "" if valid else "why",
    }
    return Event("candidate", f"{stage}/traj-{trajectory}", data)


def attempt(label: str, tokens: int = 0, **data: Any) -> Event:
    role = label.partition("/")[0]
    known = {"role": role, "parsed": True, "spatial": True, "valid": True, "code": ""}
    return Event("attempt", label, {**known, "tokens": tokens, **data})


def expansion(trajectory: int, round_: int, verdicts: str) -> Event:
    """`verdicts`: v for each valid attempt, x for each refused one."""
    attempts = [{"label": "", "valid": verdict == "v", "note": ""} for verdict in verdicts]
    data = {"node": 0, "attempts": attempts, "children": [], "fallback": "v" not in verdicts}
    return Event("expand", f"env_feedback/traj-{trajectory}/round-{round_}", data)


def node(trajectory: int, id_: int, round_: int, score: float | None, valid: bool = True) -> Event:
    data = {"round": round_, "parent": 0, "machine": "00", "valid": valid, "score": score}
    return Event("node", f"env_feedback/traj-{trajectory}/node-{id_}", data)


def evaluation(label: str, score: float | None, valid: bool = True, at: float = 0.0) -> Event:
    return Event("evaluation", label, {"valid": valid, "score": score}, at)
